// Stands before the system's calls on files, linked into a test or preloaded into a program (LD_PRELOAD), so that
// something happens at the N-th of them. The environment says what:
//   RBVH_FAULT_FOLDER  absolute; only calls on files in it count
//   RBVH_FAULT_CALLS   those that count, such as "open,rename"; unset: all that are defined below
//   RBVH_FAULT_AT      N, from 1; unset: never
//   RBVH_FAULT         kill: the process dies before the call; pause: it sleeps 0.1 s; a number: the call fails
//                      with this errno; a number and "+": all calls from then on do
//   RBVH_FAULT_LOG     a file that gets a line for each call that counts, and one when something happens
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

#define REAL(type, name, ...)                                      \
  static type (*real)(__VA_ARGS__);                                \
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

// Whether the call is to fail; errno is set.
static int fails(const char* call, const char* path, int fd) {
  const char *folder = getenv("RBVH_FAULT_FOLDER"), *calls = getenv("RBVH_FAULT_CALLS");
  const char *at = getenv("RBVH_FAULT_AT"), *fault = getenv("RBVH_FAULT");
  if (!folder || (calls && !strstr(calls, call))) return 0;
  char whole[2 * PATH_MAX] = "";
  if (!path) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    if (readlink(link, whole, sizeof whole - 1) < 0) return 0;
  } else if (path[0] == '/') {
    snprintf(whole, sizeof whole, "%s", path);
  } else {
    char here[PATH_MAX];
    snprintf(whole, sizeof whole, "%s/%s", getcwd(here, sizeof here) ? here : "", path);
  }
  if (strncmp(whole, folder, strlen(folder)) != 0) return 0;
  add_to_log(call, whole + strlen(folder));
  const int number = atomic_fetch_add(&g_count, 1) + 1;
  if (!at || !fault || number < atoi(at) || (number > atoi(at) && !strchr(fault, '+'))) return 0;
  if (number == atoi(at)) add_to_log(fault, "!");
  if (strcmp(fault, "kill") == 0) kill(getpid(), SIGKILL);
  if (strcmp(fault, "pause") == 0) {
    nanosleep(&(struct timespec){.tv_nsec = 100000000}, NULL);
    return 0;
  }
  errno = atoi(fault);
  return 1;
}

#define DEFINE_OPEN(name)                                          \
  int name(const char* path, int flags, ...) {                     \
    REAL(int, name, const char*, int, ...);                        \
    va_list rest;                                                  \
    va_start(rest, flags);                                         \
    const mode_t mode = flags & O_CREAT ? va_arg(rest, mode_t) : 0; \
    va_end(rest);                                                  \
    return fails("open", path, -1) ? -1 : real(path, flags, mode); \
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
  return fails("rename", to, -1) ? -1 : real(from, to);
}

int renameat2(int from_folder, const char* from, int to_folder, const char* to, unsigned flags) {
  REAL(int, renameat2, int, const char*, int, const char*, unsigned);
  return fails("rename", to, -1) ? -1 : real(from_folder, from, to_folder, to, flags);
}

int unlink(const char* path) {
  REAL(int, unlink, const char*);
  return fails("unlink", path, -1) ? -1 : real(path);
}
