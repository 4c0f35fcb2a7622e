/* Preloaded into a Python process: counts the calls that change files under one folder, writes down each with its
 * data, and makes one of them go wrong. Nothing is synced for real: a power loss is simulated from what was written
 * down (tests/faults/power_loss.py).
 *
 *     record: op TAB inode TAB offset TAB length TAB path TAB second path LF, then `length` bytes of data
 *     O made by open   M mkdir   X rmdir   U unlink   R rename   W write   T truncate (offset: new size)
 *     F fsync   D fsync of a folder   L fsync that failed: what it was for is lost   A a word of the program
 */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/uio.h>
#include <unistd.h>

enum mode { RECORD, EIO_ONCE, ENOSPC_ONCE, FULL, KILL, TORN };

static char root[PATH_MAX];
static int log_fd = -1;
static long at, count;
static enum mode mode;
static int short_before; /* a short write, after which the next one fails */
static int full_for;     /* calls more that find the disk full, before somebody makes room */
#define FULL_FOR 4
static char failed[PATH_MAX + 64];

#define REAL(result, name, ...) \
    static result (*real)(__VA_ARGS__); \
    if (!real) real = (result (*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

static ssize_t real_write(int fd, const void *data, size_t n) {
    REAL(ssize_t, write, int, const void *, size_t);
    return real(fd, data, n);
}

static void record(char op, ino_t inode, off_t offset, const void *data, size_t n, const char *a, const char *b) {
    char *line = malloc(2 * PATH_MAX + 128 + n);
    int length = sprintf(line, "%c\t%lu\t%ld\t%zu\t%s\t%s\n", op, (unsigned long)inode, (long)offset, n, a, b);
    if (n) memcpy(line + length, data, n);
    real_write(log_fd, line, length + n);
    free(line);
}

/* whether it is ours: below the folder, and no index that SQLite makes anew from its log */
static int ours(const char *path) {
    size_t n = strlen(root), m = strlen(path);
    if (log_fd < 0 || strncmp(path, root, n) || (path[n] && path[n] != '/')) return 0;
    return m < 4 || strcmp(path + m - 4, "-shm");
}

static int named(int folder, const char *name, char *path) {
    char base[PATH_MAX], link[64];
    if (log_fd < 0) return 0;
    if (name[0] == '/') snprintf(path, PATH_MAX, "%s", name);
    else {
        ssize_t n;
        if (folder == AT_FDCWD) n = getcwd(base, sizeof base) ? (ssize_t)strlen(base) : -1;
        else {
            sprintf(link, "/proc/self/fd/%d", folder);
            n = readlink(link, base, sizeof base - 1);
        }
        if (n < 0) return 0;
        base[n] = 0;
        snprintf(path, PATH_MAX, "%.2000s/%.2000s", base, name);
    }
    return ours(path);
}

static int opened(int fd, char *path, struct stat *status) {
    char link[64];
    ssize_t n;
    if (log_fd < 0) return 0;
    sprintf(link, "/proc/self/fd/%d", fd);
    n = readlink(link, path, PATH_MAX - 1);
    if (n < 0) return 0;
    path[n] = 0;
    return ours(path) && !fstat(fd, status) && (S_ISREG(status->st_mode) || S_ISDIR(status->st_mode));
}

/* -1: this call is to fail, errno says how; 0: go on; 1: half of it, then the end; 2: half of it and no more */
static int verdict(long number, int grows, int writes) {
    if (short_before && writes) {
        short_before = 0;
        errno = ENOSPC;
        return -1;
    }
    if (!at || number < at || (number > at && !full_for)) return 0;
    errno = ENOSPC;
    switch (mode) {
    case EIO_ONCE: errno = EIO; return -1;
    case ENOSPC_ONCE: return writes ? short_before = 1, 2 : -1;
    case FULL:
        if (number == at && grows) full_for = FULL_FOR;
        if (!grows || !full_for) return 0;
        return full_for-- == FULL_FOR && writes ? 2 : -1;
    case KILL: kill(getpid(), SIGKILL); pause(); return -1;
    case TORN: return writes;
    default: return 0;
    }
}

static int fault(const char *call, const char *path, int grows, int writes) {
    int found = verdict(__atomic_add_fetch(&count, 1, __ATOMIC_SEQ_CST), grows, writes);
    if (found && !failed[0]) snprintf(failed, sizeof failed, "%s %s", call, path + strlen(root));
    return found;
}

/* ---- asked for by the test ---- */

void faults_arm(const char *folder, const char *log, long number, int how) {
    snprintf(root, sizeof root, "%s", folder);
    at = number, mode = how, count = 0, short_before = full_for = 0, failed[0] = 0;
    log_fd = open(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
}

long faults_disarm(void) {
    if (log_fd >= 0) close(log_fd);
    log_fd = -1;
    return count;
}

const char *faults_failed(void) { return failed; }

void faults_ack(const char *word) {
    if (log_fd >= 0) record('A', 0, 0, word, strlen(word), "", "");
}

/* ---- names ---- */

static int open_at(int folder, const char *name, int flags, mode_t rights) {
    REAL(int, openat, int, const char *, int, mode_t);
    char path[PATH_MAX];
    struct stat status;
    int made, cut, fd;
    if ((flags & O_TMPFILE) == O_TMPFILE || !(flags & (O_CREAT | O_TRUNC)) || !named(folder, name, path))
        return real(folder, name, flags, rights);
    made = (flags & O_CREAT) && lstat(path, &status);
    cut = !made && (flags & O_TRUNC) && !stat(path, &status) && status.st_size;
    if ((made || cut) && fault(made ? "open (new)" : "open (truncate)", path, made, 0) < 0) return -1;
    fd = real(folder, name, flags, rights);
    if (fd >= 0 && !fstat(fd, &status)) {
        if (made) record('O', status.st_ino, 0, 0, 0, path, "");
        if (cut) record('T', status.st_ino, 0, 0, 0, path, "");
    }
    return fd;
}

#define OPENED(flags) \
    mode_t rights = 0; \
    if ((flags) & (O_CREAT | O_TMPFILE)) { \
        va_list rest; \
        va_start(rest, flags); \
        rights = va_arg(rest, mode_t); \
        va_end(rest); \
    }

int open(const char *name, int flags, ...) { OPENED(flags) return open_at(AT_FDCWD, name, flags, rights); }
int open64(const char *name, int flags, ...) { OPENED(flags) return open_at(AT_FDCWD, name, flags | O_LARGEFILE, rights); }
int openat(int folder, const char *name, int flags, ...) { OPENED(flags) return open_at(folder, name, flags, rights); }
int openat64(int folder, const char *name, int flags, ...) { OPENED(flags) return open_at(folder, name, flags, rights); }

int mkdirat(int folder, const char *name, mode_t rights) {
    REAL(int, mkdirat, int, const char *, mode_t);
    char path[PATH_MAX];
    struct stat status;
    int done, mine = named(folder, name, path);
    if (mine && lstat(path, &status) && fault("mkdir", path, 1, 0) < 0) return -1;
    done = real(folder, name, rights);
    if (!done && mine) record('M', 0, 0, 0, 0, path, "");
    return done;
}
int mkdir(const char *name, mode_t rights) { return mkdirat(AT_FDCWD, name, rights); }

int unlinkat(int folder, const char *name, int flags) {
    REAL(int, unlinkat, int, const char *, int);
    char path[PATH_MAX];
    struct stat status;
    int done, mine = named(folder, name, path);
    if (mine && !lstat(path, &status) && fault("unlink", path, 0, 0) < 0) return -1;
    done = real(folder, name, flags);
    if (!done && mine) record(flags & AT_REMOVEDIR ? 'X' : 'U', 0, 0, 0, 0, path, "");
    return done;
}
int unlink(const char *name) { return unlinkat(AT_FDCWD, name, 0); }
int rmdir(const char *name) { return unlinkat(AT_FDCWD, name, AT_REMOVEDIR); }

int renameat(int from_folder, const char *from, int to_folder, const char *to) {
    REAL(int, renameat, int, const char *, int, const char *);
    char a[PATH_MAX], b[PATH_MAX];
    int done, mine = named(from_folder, from, a) & named(to_folder, to, b);
    if (mine && fault("rename", b, 1, 0) < 0) return -1;
    done = real(from_folder, from, to_folder, to);
    if (!done && mine) record('R', 0, 0, 0, 0, a, b);
    return done;
}
int rename(const char *from, const char *to) { return renameat(AT_FDCWD, from, AT_FDCWD, to); }

/* ---- data ---- */

static ssize_t write_at(int fd, const void *data, size_t n, off_t offset) {
    REAL(ssize_t, pwrite64, int, const void *, size_t, off_t);
    return offset < 0 ? real_write(fd, data, n) : real(fd, data, n, offset);
}

static ssize_t write_or_fail(const char *call, int fd, const void *data, size_t n, off_t offset) {
    char path[PATH_MAX];
    struct stat status;
    off_t where;
    ssize_t done;
    int what;
    if (!n || !opened(fd, path, &status)) return write_at(fd, data, n, offset);
    where = offset >= 0 ? offset : fcntl(fd, F_GETFL) & O_APPEND ? status.st_size : lseek(fd, 0, SEEK_CUR);
    what = fault(call, path, 1, 1);
    if (what < 0) return -1;
    done = write_at(fd, data, what ? n / 2 : n, offset);
    if (done > 0) record('W', status.st_ino, where, data, done, path, "");
    if (what == 1) kill(getpid(), SIGKILL), pause();
    if (what == 2 && !done) return errno = ENOSPC, short_before = 0, -1;
    return done;
}

ssize_t write(int fd, const void *data, size_t n) { return write_or_fail("write", fd, data, n, -1); }
ssize_t pwrite(int fd, const void *data, size_t n, off_t o) { return write_or_fail("pwrite", fd, data, n, o); }
ssize_t pwrite64(int fd, const void *data, size_t n, off_t o) { return write_or_fail("pwrite", fd, data, n, o); }

static ssize_t write_pieces(int fd, const struct iovec *pieces, int n, off_t offset) {
    size_t total = 0;
    ssize_t done;
    char *data, *end;
    for (int k = 0; k < n; k++) total += pieces[k].iov_len;
    end = data = malloc(total + 1);
    for (int k = 0; k < n; k++) end = (char *)memcpy(end, pieces[k].iov_base, pieces[k].iov_len) + pieces[k].iov_len;
    done = write_or_fail("writev", fd, data, total, offset);
    free(data);
    return done;
}
ssize_t writev(int fd, const struct iovec *p, int n) { return write_pieces(fd, p, n, -1); }
ssize_t pwritev(int fd, const struct iovec *p, int n, off_t o) { return write_pieces(fd, p, n, o); }
ssize_t pwritev64(int fd, const struct iovec *p, int n, off_t o) { return write_pieces(fd, p, n, o); }

int ftruncate64(int fd, off_t size) {
    REAL(int, ftruncate64, int, off_t);
    char path[PATH_MAX];
    struct stat status;
    int done, mine = opened(fd, path, &status);
    if (mine && fault("ftruncate", path, size > status.st_size, 0) < 0) return -1;
    done = real(fd, size);
    if (!done && mine) record('T', status.st_ino, size, 0, 0, path, "");
    return done;
}
int ftruncate(int fd, off_t size) { return ftruncate64(fd, size); }

int truncate64(const char *name, off_t size) {
    int done, fd = open(name, O_WRONLY | O_CLOEXEC);
    if (fd < 0) return -1;
    done = ftruncate64(fd, size);
    close(fd);
    return done;
}
int truncate(const char *name, off_t size) { return truncate64(name, size); }

static int sync_or_fail(const char *call, int fd, int (*real)(int)) {
    char path[PATH_MAX];
    struct stat status;
    if (!opened(fd, path, &status)) return real(fd);
    if (fault(call, path, 0, 0) < 0) {
        if (S_ISREG(status.st_mode)) record('L', status.st_ino, 0, 0, 0, path, "");
        return -1;
    }
    record(S_ISDIR(status.st_mode) ? 'D' : 'F', status.st_ino, 0, 0, 0, path, "");
    return 0;
}
int fsync(int fd) {
    REAL(int, fsync, int);
    return sync_or_fail("fsync", fd, real);
}
int fdatasync(int fd) {
    REAL(int, fdatasync, int);
    return sync_or_fail("fdatasync", fd, real);
}
