// Stands before the system's calls on files, linked into a test or preloaded into a program (LD_PRELOAD), so
// that something happens at the N-th of them. The environment says what:
//   RBVH_FAULT_FOLDER  absolute; only calls on files in it count, and those of fail_memory.c if named
//   RBVH_FAULT_CALLS   those that count, such as "open,rename"; unset: all that are defined below
//   RBVH_FAULT_AT      N, from 1; unset: never
//   RBVH_FAULT         kill, term, int: the process gets this signal before the call; pause: it sleeps 0.1 s;
//   a
//                      number: the call fails with this errno; a number and "+": all calls from then on do
//   RBVH_FAULT_LOG     a file that gets a line for each call that counts ("from" before a rename's), and one
//   when
//                      something happens
// fsync() does nothing else: no test cuts the power.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <limits.h>
#include <signal.h>
#include <stdarg.h>
#include <stdatomic.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/types.h>
#include <time.h>
#include <unistd.h>

#define REAL(type, name, ...)       \
  static type (*real)(__VA_ARGS__); \
  if (!real) real = (type(*)(__VA_ARGS__))dlsym(RTLD_NEXT, #name)

static atomic_int g_count;

// For a test that links this and changes the environment: counts from 1 again.
void restart_faults(void) { g_count = 0; }

static void add_to_log(const char* call, const char* path) {
  REAL(int, open, const char*, int, ...);
  const char* log = getenv("RBVH_FAULT_LOG");
  const int fd = log ? real(log, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0666) : -1;
  if (fd < 0) return;
  dprintf(fd, "%s %s\n", call, path);
  close(fd);
}

// Of a call that counts: whether it is to fail; errno is set.
static int meets_fault(void) {
  const char *at = getenv("RBVH_FAULT_AT"), *fault = getenv("RBVH_FAULT");
  const int number = atomic_fetch_add(&g_count, 1) + 1;
  if (!at || !fault || number < atoi(at) || (number > atoi(at) && !strchr(fault, '+'))) return 0;
  if (number == atoi(at)) add_to_log(fault, "!");
  if (strcmp(fault, "kill") == 0) kill(getpid(), SIGKILL);
  if (strcmp(fault, "term") == 0) kill(getpid(), SIGTERM);
  if (strcmp(fault, "int") == 0) kill(getpid(), SIGINT);
  if (strcmp(fault, "pause") == 0) nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
  errno = atoi(fault);
  return errno != 0;
}

// For calls on no file, which count where they are named.
int fails_anywhere(const char* call) {
  const char* calls = getenv("RBVH_FAULT_CALLS");
  if (!calls || !strstr(calls, call)) return 0;
  add_to_log(call, "");
  return meets_fault();
}

// The part of a path, or of that of an open file, that follows the folder; NULL for one that is not in it.
static const char* below_folder(const char* path, int fd, char whole[2 * PATH_MAX]) {
  const char* folder = getenv("RBVH_FAULT_FOLDER");
  if (!folder) return NULL;
  if (!path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    const ssize_t size = readlink(link, whole, 2 * PATH_MAX - 1);
    if (size < 0) return NULL;
    whole[size] = 0;
  } else if (path[0] == '/') {
    snprintf(whole, 2 * PATH_MAX, "%s", path);
  } else {
    char here[PATH_MAX];
    snprintf(whole, 2 * PATH_MAX, "%s/%s", getcwd(here, sizeof here) ? here : "", path);
  }
  return strncmp(whole, folder, strlen(folder)) == 0 ? whole + strlen(folder) : NULL;
}

static int fails(const char* call, const char* path, int fd) {
  const char* calls = getenv("RBVH_FAULT_CALLS");
  char whole[2 * PATH_MAX];
  const char* below = calls && !strstr(calls, call) ? NULL : below_folder(path, fd, whole);
  if (!below) return 0;
  add_to_log(call, below);
  return meets_fault();
}

static int rename_fails(const char* from, const char* to) {
  const char* calls = getenv("RBVH_FAULT_CALLS");
  char whole[2 * PATH_MAX];
  const char* below = calls && !strstr(calls, "rename") ? NULL : below_folder(from, -1, whole);
  if (below) add_to_log("from", below);
  return fails("rename", to, -1);
}

#define DEFINE_OPEN(name)                                           \
  int name(const char* path, int flags, ...) {                      \
    REAL(int, name, const char*, int, ...);                         \
    va_list rest;                                                   \
    va_start(rest, flags);                                          \
    const mode_t mode = flags & O_CREAT ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                                   \
    return fails("open", path, -1) ? -1 : real(path, flags, mode);  \
  }
DEFINE_OPEN(open)
DEFINE_OPEN(open64)

ssize_t write(int fd, const void* data, size_t size) {
  REAL(ssize_t, write, int, const void*, size_t);
  return fails("write", NULL, fd) ? -1 : real(fd, data, size);
}

int fsync(int fd) { return fails("fsync", NULL, fd) ? -1 : 0; }

int flock(int fd, int operation) {
  REAL(int, flock, int, int);
  return fails("flock", NULL, fd) ? -1 : real(fd, operation);
}

int rename(const char* from, const char* to) {
  REAL(int, rename, const char*, const char*);
  return rename_fails(from, to) ? -1 : real(from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  REAL(int, renameat2, int, const char*, int, const char*, unsigned);
  return rename_fails(from, to) ? -1 : real(from_folder, from, to_folder, to, flags);
}

int unlink(const char* path) {
  REAL(int, unlink, const char*);
  return fails("unlink", path, -1) ? -1 : real(path);
}
