/* First process of the test machine: loads modules, enters the host's file system (read only), runs one command. */
#define _GNU_SOURCE
#include <fcntl.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/mount.h>
#include <sys/reboot.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <sys/wait.h>
#include <unistd.h>

static void fail(const char *what) {
    perror(what);
    fflush(NULL);
    sync();
    reboot(RB_POWER_OFF);
    _exit(1);
}

int main(void) {
    char line[256];
    FILE *list = fopen("/modules", "r");
    if (!list)
        fail("/modules");
    while (fgets(line, sizeof line, list)) {
        line[strcspn(line, "\n")] = 0;
        int module = open(line, O_RDONLY);
        if (module < 0 || syscall(SYS_finit_module, module, "", 0) < 0)
            perror(line); /* a built-in twin is no harm; what is really missing shows below */
        if (module >= 0)
            close(module);
    }
    fclose(list);
    mkdir("/host", 0755);
    if (mount("host", "/host", "9p", MS_RDONLY, "trans=virtio,version=9p2000.L,msize=524288,cache=loose"))
        fail("the host's file system (9p)");
    if (mount("devtmpfs", "/host/dev", "devtmpfs", 0, "") || mount("proc", "/host/proc", "proc", 0, "") ||
        mount("sysfs", "/host/sys", "sysfs", 0, "") || mount("tmpfs", "/host/run", "tmpfs", 0, ""))
        fail("dev, proc, sys, run");
    /* /command: working directory, then arguments, one a line. */
    static char words[32][1024];
    char *arguments[32] = {0};
    int count = 0;
    FILE *command = fopen("/command", "r");
    while (command && count < 31 && fgets(words[count], sizeof words[0], command)) {
        words[count][strcspn(words[count], "\n")] = 0;
        arguments[count] = words[count];
        count++;
    }
    if (count < 2 || chroot("/host") || chdir(words[0]))
        fail("chroot");
    pid_t child = fork();
    if (child == 0) {
        execv(arguments[1], arguments + 1);
        perror(arguments[1]);
        _exit(127);
    }
    int status = 0;
    waitpid(child, &status, 0);
    printf("EXIT %d\n", WIFEXITED(status) ? WEXITSTATUS(status) : 128 + WTERMSIG(status));
    fflush(NULL);
    reboot(RB_POWER_OFF);
    return 0;
}
