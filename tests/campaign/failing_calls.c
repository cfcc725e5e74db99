/* Calls that fail where the environment says so, loaded before everything else (LD_PRELOAD).

   FAIL_CALL   write, fsync, rename, open, truncate, mkdir, close or unlink: the k-th of them; memory: the k-th
               request for a megabyte or more
   FAIL_AT     k, from 1; 0 only counts
   FAIL_WITH   errno
   FAIL_HOW    once, always (this one and all later), short (half of what was to be written), kill (SIGKILL there)
   FAIL_UNDER  only files whose path holds this text
   FAIL_COUNT  file to which each process adds the number of its calls when it ends

   Each process counts for itself. A process that was forked after it was loaded reads the environment anew with
   arm_faults(), and writes its number of calls with note_faults() where it ends without destructors. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static atomic_long seen;
static char call[32], how[16], under[4096], count_file[4096];
static long at;
static int error_number, armed;

static void copy(char *target, size_t size, const char *name) {
    const char *value = getenv(name);
    snprintf(target, size, "%s", value ? value : "");
}

void arm_faults(void) {
    copy(call, sizeof call, "FAIL_CALL");
    copy(how, sizeof how, "FAIL_HOW");
    copy(under, sizeof under, "FAIL_UNDER");
    copy(count_file, sizeof count_file, "FAIL_COUNT");
    const char *k = getenv("FAIL_AT"), *with = getenv("FAIL_WITH");
    at = k ? atol(k) : 0;
    error_number = with ? atoi(with) : ENOSPC;
    atomic_store(&seen, 0);
    armed = call[0] != 0;
}

void note_faults(void) {
    if (!armed || !count_file[0]) return;
    armed = 0;
    char line[64];
    int n = snprintf(line, sizeof line, "%ld %ld\n", (long)getpid(), atomic_load(&seen));
    int fd = open(count_file, O_WRONLY | O_CREAT | O_APPEND, 0666);
    if (fd >= 0) {
        if (write(fd, line, (size_t)n) < 0) { /* nothing can be done about it */ }
        close(fd);
    }
}

__attribute__((constructor)) static void begin(void) { arm_faults(); }
__attribute__((destructor)) static void end(void) { note_faults(); }

static int is_under(const char *path) { return path && strncmp(path, "/dev/", 5) && (!under[0] || strstr(path, under)); }

static int is_fd_under(int fd) {
    char link[64], path[4096];
    struct stat status;
    if (fstat(fd, &status) || !S_ISREG(status.st_mode)) return 0;
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, path, sizeof path - 1);
    if (n < 0) return 0;
    path[n] = 0;
    return is_under(path);
}

static int fails(const char *name, int concerns) {
    if (!armed || strcmp(call, name) || !concerns) return 0;
    long k = atomic_fetch_add(&seen, 1) + 1;
    if (!at || k < at || (k > at && strcmp(how, "always"))) return 0;
    if (!strcmp(how, "kill")) kill(getpid(), SIGKILL);
    errno = error_number;
    return 1;
}

static int is_short(size_t n) { return !strcmp(how, "short") && n > 1; }

#define REAL(type, name, arguments) \
    static type (*real_##name) arguments; \
    if (!real_##name) *(void **)&real_##name = dlsym(RTLD_NEXT, #name)

ssize_t write(int fd, const void *data, size_t n) {
    REAL(ssize_t, write, (int, const void *, size_t));
    if (armed && fd > 2 && fails("write", is_fd_under(fd))) return is_short(n) ? real_write(fd, data, n / 2) : -1;
    return real_write(fd, data, n);
}
ssize_t pwrite(int fd, const void *data, size_t n, off_t place) {
    REAL(ssize_t, pwrite, (int, const void *, size_t, off_t));
    if (armed && fails("write", is_fd_under(fd))) return is_short(n) ? real_pwrite(fd, data, n / 2, place) : -1;
    return real_pwrite(fd, data, n, place);
}
ssize_t pwrite64(int fd, const void *data, size_t n, off64_t place) {
    REAL(ssize_t, pwrite64, (int, const void *, size_t, off64_t));
    if (armed && fails("write", is_fd_under(fd))) return is_short(n) ? real_pwrite64(fd, data, n / 2, place) : -1;
    return real_pwrite64(fd, data, n, place);
}
ssize_t writev(int fd, const struct iovec *parts, int n) {
    REAL(ssize_t, writev, (int, const struct iovec *, int));
    if (armed && fd > 2 && fails("write", is_fd_under(fd))) return -1;
    return real_writev(fd, parts, n);
}
size_t fwrite(const void *data, size_t size, size_t n, FILE *file) {
    REAL(size_t, fwrite, (const void *, size_t, size_t, FILE *));
    if (armed && fileno(file) > 2 && fails("write", is_fd_under(fileno(file)))) return 0;
    return real_fwrite(data, size, n, file);
}
int fsync(int fd) {
    REAL(int, fsync, (int));
    return armed && fails("fsync", 1) ? -1 : real_fsync(fd);
}
int fdatasync(int fd) {
    REAL(int, fdatasync, (int));
    return armed && fails("fsync", 1) ? -1 : real_fdatasync(fd);
}
int rename(const char *from, const char *to) {
    REAL(int, rename, (const char *, const char *));
    return armed && fails("rename", is_under(to)) ? -1 : real_rename(from, to);
}
int renameat(int a, const char *from, int b, const char *to) {
    REAL(int, renameat, (int, const char *, int, const char *));
    return armed && fails("rename", is_under(to)) ? -1 : real_renameat(a, from, b, to);
}
int link(const char *from, const char *to) {
    REAL(int, link, (const char *, const char *));
    return armed && fails("rename", is_under(to)) ? -1 : real_link(from, to);
}
int mkdir(const char *path, mode_t mode) {
    REAL(int, mkdir, (const char *, mode_t));
    return armed && fails("mkdir", is_under(path)) ? -1 : real_mkdir(path, mode);
}
int unlink(const char *path) {
    REAL(int, unlink, (const char *));
    return armed && fails("unlink", is_under(path)) ? -1 : real_unlink(path);
}
int ftruncate(int fd, off_t n) {
    REAL(int, ftruncate, (int, off_t));
    return armed && fails("truncate", is_fd_under(fd)) ? -1 : real_ftruncate(fd, n);
}
int ftruncate64(int fd, off64_t n) {
    REAL(int, ftruncate64, (int, off64_t));
    return armed && fails("truncate", is_fd_under(fd)) ? -1 : real_ftruncate64(fd, n);
}
int close(int fd) {
    REAL(int, close, (int));
    if (armed && !strcmp(call, "close") && fails("close", is_fd_under(fd) && (fcntl(fd, F_GETFL) & O_ACCMODE) != O_RDONLY)) {
        real_close(fd);
        errno = error_number;
        return -1;
    }
    return real_close(fd);
}

extern void *__libc_malloc(size_t), *__libc_calloc(size_t, size_t), *__libc_realloc(void *, size_t);
#define LARGE ((size_t)1 << 20)

void *malloc(size_t n) { return armed && n >= LARGE && fails("memory", 1) ? NULL : __libc_malloc(n); }
void *calloc(size_t n, size_t size) {
    return armed && size && n >= LARGE / size && fails("memory", 1) ? NULL : __libc_calloc(n, size);
}
void *realloc(void *there, size_t n) {
    return armed && n >= LARGE && fails("memory", 1) ? NULL : __libc_realloc(there, n);
}

#define WRITES(flags) ((flags) & (O_WRONLY | O_RDWR | O_CREAT))
#define OPEN(name) \
    int name(const char *path, int flags, ...) { \
        REAL(int, name, (const char *, int, ...)); \
        mode_t mode = 0; \
        if (flags & (O_CREAT | O_TMPFILE)) { va_list more; va_start(more, flags); mode = va_arg(more, mode_t); va_end(more); } \
        return armed && fails("open", WRITES(flags) && is_under(path)) ? -1 : real_##name(path, flags, mode); \
    }
#define OPENAT(name) \
    int name(int folder, const char *path, int flags, ...) { \
        REAL(int, name, (int, const char *, int, ...)); \
        mode_t mode = 0; \
        if (flags & (O_CREAT | O_TMPFILE)) { va_list more; va_start(more, flags); mode = va_arg(more, mode_t); va_end(more); } \
        return armed && fails("open", WRITES(flags) && is_under(path)) ? -1 : real_##name(folder, path, flags, mode); \
    }
OPEN(open)
OPEN(open64)
OPENAT(openat)
OPENAT(openat64)
