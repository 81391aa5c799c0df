/* Starts draglag's EtherCAT process with the two capabilities it needs, and nothing else.
 *
 * Installed by install.sh with cap_net_raw,cap_net_admin=ep, owned by root, executable by the group draglag only.
 * Interpreter and interfaces are fixed when this is compiled (-DDRAGLAG_PYTHON="…" -DDRAGLAG_INTERFACES="eth1,eth2"),
 * and so is the command that its messages name for installing it again (-DDRAGLAG_INSTALL="sudo …").
 * Arguments are checked, the environment is emptied, descriptors are closed, and every component of the interpreter's
 * path must still belong to root and be writable by nobody else: whoever may start this can exchange EtherCAT frames on
 * those interfaces, and no more.
 */
#define _GNU_SOURCE
#include <ctype.h>
#include <fcntl.h>
#include <limits.h>
#include <linux/capability.h>
#include <stdio.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/stat.h>
#include <sys/statvfs.h>
#include <sys/syscall.h>
#include <unistd.h>

#if !defined(DRAGLAG_PYTHON) || !defined(DRAGLAG_INTERFACES) || !defined(DRAGLAG_INSTALL)
#error "compile it by install.sh, which defines DRAGLAG_PYTHON, DRAGLAG_INTERFACES and DRAGLAG_INSTALL"
#endif

#define NEEDED ((1u << CAP_NET_RAW) | (1u << CAP_NET_ADMIN))
#define MOST_ARGUMENTS 9 /* --probe and eight interfaces */
#define LONGEST_NAME 15  /* of an interface, IFNAMSIZ - 1 */

static int is_number(const char *text)
{
    size_t length = strlen(text);
    return length >= 1 && length <= 9 && strspn(text, "0123456789") == length;
}

static int is_interface(const char *text)
{
    size_t length = strlen(text);
    if (length < 1 || length > LONGEST_NAME || text[0] == '-')
        return 0;
    for (size_t i = 0; i < length; i++)
        if (!isalnum((unsigned char)text[i]) && !strchr("._-:@", text[i]))
            return 0;
    return 1;
}

static int is_allowed(const char *name)
{
    size_t length = strlen(name);
    for (const char *at = DRAGLAG_INTERFACES; *at; at += strcspn(at, ","), at += *at == ',')
        if (strcspn(at, ",") == length && !strncmp(at, name, length))
            return 1;
    return 0;
}

static int acceptable(int argc, char **argv)
{
    if (argc == 2 && !strcmp(argv[1], "--check"))
        return 1;
    if (argc >= 2 && argc <= MOST_ARGUMENTS && !strcmp(argv[1], "--probe")) {
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

/* Whether a file or folder belongs to root, is writable by nobody else, and lies on a file system that says so with a
 * right: what is mounted nosuid (removable media, a user's own mounts) may say of anything that it is root's. */
static int is_root_s(const char *path, const struct stat *found)
{
    struct statvfs mounted;
    return !found->st_uid && !(found->st_mode & (S_IWGRP | S_IWOTH)) && !statvfs(path, &mounted) &&
           !(mounted.f_flag & ST_NOSUID);
}

/* Whether each component of an absolute path, also of what its links lead through, is root's alone. The path is walked
 * as the kernel walks it: resolving it as a whole would skip folders on the way. */
static int is_trusted(const char *path)
{
    char rest[PATH_MAX], next[PATH_MAX], target[PATH_MAX], here[PATH_MAX] = "";
    struct stat found;
    int links = 40; /* as many as the kernel follows */

    if (path[0] != '/' || strlen(path) >= sizeof rest || stat("/", &found) || !is_root_s("/", &found))
        return 0;
    strcpy(rest, path);
    while (*rest) {
        char part[PATH_MAX];
        size_t skipped = strspn(rest, "/"), length = strcspn(rest + skipped, "/");
        memcpy(part, rest + skipped, length);
        part[length] = '\0';
        memmove(rest, rest + skipped + length, strlen(rest + skipped + length) + 1);
        if (!length || !strcmp(part, "."))
            continue;
        if (!strcmp(part, "..")) {
            char *last = strrchr(here, '/');
            if (last)
                *last = '\0';
            continue;
        }
        if ((size_t)snprintf(next, sizeof next, "%s/%s", here, part) >= sizeof next || lstat(next, &found) || found.st_uid)
            return 0;
        if (S_ISLNK(found.st_mode)) {
            ssize_t size = readlink(next, target, sizeof target - 1);
            if (size < 1 || --links < 1 || (size_t)size + strlen(rest) + 2 > sizeof rest)
                return 0;
            target[size] = '\0';
            if (target[0] == '/')
                here[0] = '\0';
            memmove(rest + size + 1, rest, strlen(rest) + 1);
            memcpy(rest, target, (size_t)size);
            rest[size] = '/';
        } else {
            if (!is_root_s(next, &found))
                return 0;
            strcpy(here, next);
        }
    }
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

/* Only standard input, output and error go on, and all three exist: a file opened later must not become one of them. */
static int only_standard_descriptors(void)
{
    for (int fd = 0; fd <= 2; fd++)
        if (fcntl(fd, F_GETFD) < 0 && open("/dev/null", O_RDWR) != fd)
            return -1;
#ifdef SYS_close_range
    if (!syscall(SYS_close_range, 3u, ~0u, 0u))
        return 0;
#endif
    for (int fd = 3; fd < 1 << 16; fd++) /* a kernel before 5.9 */
        close(fd);
    return 0;
}

int main(int argc, char **argv)
{
    char *command[6 + MOST_ARGUMENTS + 1] = {DRAGLAG_PYTHON, "-I", "-m", "draglag_devices.ethercat_laser.master",
                                             "--only", DRAGLAG_INTERFACES};
    char *environment[] = {"PATH=/usr/bin:/bin", "LANG=C.UTF-8", NULL};
    int given = 6;

    if (only_standard_descriptors() || chdir("/"))
        return 1;
    if (!acceptable(argc, argv)) {
        fputs("usage: draglag-ethercat-master IFACE [--channel N] [--position N] [--first-epoch N] | --probe [IFACE ...]"
              " | --check\n", stderr);
        return 2;
    }
    if (argv[1][0] != '-' && !is_allowed(argv[1])) {
        /* As a message of the bus process, so that it reaches people like its own refusals: words for people are
           their template and its arguments (draglag.messages). */
        printf("{\"m\": \"refused\", \"code\": \"not_allowed\", \"problem\": {\"template\": \"the network interface {name} "
               "was not allowed when the EtherCAT helper was installed, only {others}\", \"arguments\": {\"name\": \"%s\", "
               "\"others\": \"%s\"}}, \"remedy\": {\"template\": \"install it again for this interface: {command}\", "
               "\"arguments\": {\"command\": \"" DRAGLAG_INSTALL " %s\"}}}\n", argv[1], DRAGLAG_INTERFACES, argv[1]);
        return 1;
    }
    if (!is_trusted(DRAGLAG_PYTHON)) {
        fputs(DRAGLAG_PYTHON " or a folder above it can be changed by others than root: " DRAGLAG_INSTALL "\n", stderr);
        return 1;
    }
    /* Without the capabilities the process starts all the same and says itself what is missing. */
    (void)keep_across_exec();
    /* Of the names behind --probe only those that are allowed: the others are not asked. */
    for (int i = 1; i < argc; i++)
        if (i == 1 || strcmp(argv[1], "--probe") || is_allowed(argv[i]))
            command[given++] = argv[i];
    execve(DRAGLAG_PYTHON, command, environment);
    perror(DRAGLAG_PYTHON);
    return 1;
}
