/* A library that is loaded before the C library, and makes one call fail with EIO: the call number FAIL_AT of the kind FAIL_CALL on
 * a file whose path has the text FAIL_PATH. It then creates the file FAIL_MARK. */

#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static int fails(const char *call, const char *path) {
    static atomic_int calls;
    const char *kind = getenv("FAIL_CALL"), *text = getenv("FAIL_PATH"), *at = getenv("FAIL_AT"), *mark = getenv("FAIL_MARK");
    if (!kind || !text || !at || !mark || strcmp(kind, call) != 0 || !strstr(path, text)) return 0;
    if (atomic_fetch_add(&calls, 1) + 1 != atoi(at)) return 0;
    close(open(mark, O_CREAT | O_WRONLY, 0600));
    errno = EIO;
    return 1;
}

static int fails_on(const char *call, int file) {
    char link[64], path[4096];
    snprintf(link, sizeof link, "/proc/self/fd/%d", file);
    ssize_t length = readlink(link, path, sizeof path - 1);
    if (length < 0) return 0;
    path[length] = 0;
    return fails(call, path);
}

#define REAL(type, name, ...) ((type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, name))

ssize_t write(int file, const void *bytes, size_t length) {
    if (fails_on("write", file)) return -1;
    return REAL(ssize_t, "write", int, const void *, size_t)(file, bytes, length);
}

ssize_t writev(int file, const struct iovec *parts, int count) {
    if (fails_on("write", file)) return -1;
    return REAL(ssize_t, "writev", int, const struct iovec *, int)(file, parts, count);
}

ssize_t pwrite64(int file, const void *bytes, size_t length, off64_t at) {
    if (fails_on("write", file)) return -1;
    return REAL(ssize_t, "pwrite64", int, const void *, size_t, off64_t)(file, bytes, length, at);
}

off64_t lseek64(int file, off64_t offset, int whence) {
    if (fails_on("seek", file)) return -1;
    return REAL(off64_t, "lseek64", int, off64_t, int)(file, offset, whence);
}

int ftruncate64(int file, off64_t length) {
    if (fails_on("truncate", file)) return -1;
    return REAL(int, "ftruncate64", int, off64_t)(file, length);
}

int fsync(int file) {
    if (fails_on("sync", file)) return -1;
    return REAL(int, "fsync", int)(file);
}

int fdatasync(int file) {
    if (fails_on("sync", file)) return -1;
    return REAL(int, "fdatasync", int)(file);
}

int rename(const char *from, const char *to) {
    if (fails("rename", to)) return -1;
    return REAL(int, "rename", const char *, const char *)(from, to);
}
