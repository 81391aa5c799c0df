/* Starts draglag's EtherCAT process with the two capabilities it needs, and nothing else.
 *
 * Installed by install.sh with cap_net_raw,cap_net_admin=ep, owned by root, executable by the group draglag only.
 * The interpreter is fixed when this is compiled (-DDRAGLAG_PYTHON="..."), the arguments are checked, the
 * environment is emptied: whoever may start it can exchange EtherCAT frames on an interface, and no more.
 */
#include <ctype.h>
#include <linux/capability.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/syscall.h>
#include <unistd.h>

#ifndef DRAGLAG_PYTHON
#error "compile with -DDRAGLAG_PYTHON=\"/path/of/the/interpreter\""
#endif

#define NEEDED ((1u << CAP_NET_RAW) | (1u << CAP_NET_ADMIN))

static int is_number(const char *text)
{
    size_t length = strlen(text);
    return length >= 1 && length <= 9 && strspn(text, "0123456789") == length;
}

static int is_interface(const char *text)
{
    size_t length = strlen(text);
    if (length < 1 || length > 15 || text[0] == '-')
        return 0;
    for (size_t i = 0; i < length; i++)
        if (!isalnum((unsigned char)text[i]) && !strchr("._-:@", text[i]))
            return 0;
    return 1;
}

static int acceptable(int argc, char **argv)
{
    if (argc >= 2 && argc <= 9 && !strcmp(argv[1], "--probe")) {
        for (int i = 2; i < argc; i++)
            if (!is_interface(argv[i]))
                return 0;
        return 1;
    }
    if (argc < 2 || argc > 8 || argc % 2 || !is_interface(argv[1]))
        return 0;
    for (int i = 2; i < argc; i += 2)
        if ((strcmp(argv[i], "--channel") && strcmp(argv[i], "--position") && strcmp(argv[i], "--first-epoch")) ||
            !is_number(argv[i + 1]))
            return 0;
    return 1;
}

static int keep_across_exec(void)
{
    struct __user_cap_header_struct header = {_LINUX_CAPABILITY_VERSION_3, 0};
    struct __user_cap_data_struct data[2] = {{NEEDED, NEEDED, NEEDED}, {0, 0, 0}};
    if (syscall(SYS_capset, &header, data))
        return -1;
    if (prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, CAP_NET_RAW, 0, 0) ||
        prctl(PR_CAP_AMBIENT, PR_CAP_AMBIENT_RAISE, CAP_NET_ADMIN, 0, 0))
        return -1;
    return prctl(PR_SET_NO_NEW_PRIVS, 1, 0, 0, 0);
}

int main(int argc, char **argv)
{
    char *command[4 + 8 + 1] = {DRAGLAG_PYTHON, "-I", "-m", "draglag_devices.ethercat_laser.master"};
    char *environment[] = {"PATH=/usr/bin:/bin", "LANG=C.UTF-8", NULL};

    if (!acceptable(argc, argv)) {
        fputs("usage: draglag-ethercat-master IFACE [--channel N] [--position N] [--first-epoch N] | --probe [IFACE ...]\n",
              stderr);
        return 2;
    }
    /* Without the capabilities the process starts all the same and says itself what is missing. */
    (void)keep_across_exec();
    for (int i = 1; i < argc; i++)
        command[3 + i] = argv[i];
    execve(DRAGLAG_PYTHON, command, environment);
    perror(DRAGLAG_PYTHON);
    return 1;
}
