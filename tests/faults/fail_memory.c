// As fail_syscalls.c, for requests of more than 1 MB: malloc (all of its family), mmap, and OpenCL's buffers
// of any size. Preloaded only.
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <stddef.h>
#include <stdint.h>
#include <sys/mman.h>

int fails_anywhere(const char* call);

// dlsym() itself allocates; these are glibc's.
void* __libc_malloc(size_t size);
void* __libc_calloc(size_t count, size_t size);
void* __libc_realloc(void* old, size_t size);
void* __libc_memalign(size_t alignment, size_t size);

static int is_refused(size_t size) { return size > 1 << 20 && fails_anywhere("malloc"); }

void* malloc(size_t size) { return is_refused(size) ? NULL : __libc_malloc(size); }

void* calloc(size_t count, size_t size) {
  return is_refused(count * size) ? NULL : __libc_calloc(count, size);
}

void* realloc(void* old, size_t size) { return is_refused(size) ? NULL : __libc_realloc(old, size); }

void* aligned_alloc(size_t alignment, size_t size) {
  return is_refused(size) ? NULL : __libc_memalign(alignment, size);
}

int posix_memalign(void** result, size_t alignment, size_t size) {
  void* memory = aligned_alloc(alignment, size);
  if (memory) *result = memory;
  return memory ? 0 : ENOMEM;
}

void* mmap(void* at, size_t size, int protection, int flags, int fd, off_t offset) {
  static void* (*real)(void*, size_t, int, int, int, off_t);
  if (!real) real = (void* (*)(void*, size_t, int, int, int, off_t))dlsym(RTLD_NEXT, "mmap");
  return size > 1 << 20 && fails_anywhere("mmap") ? MAP_FAILED
                                                  : real(at, size, protection, flags, fd, offset);
}

void* clCreateBuffer(void* context, uint64_t flags, size_t size, void* host, int32_t* error) {
  static void* (*real)(void*, uint64_t, size_t, void*, int32_t*);
  if (!real) real = (void* (*)(void*, uint64_t, size_t, void*, int32_t*))dlsym(RTLD_NEXT, "clCreateBuffer");
  if (!fails_anywhere("clCreateBuffer")) return real(context, flags, size, host, error);
  if (error) *error = -4;  // CL_MEM_OBJECT_ALLOCATION_FAILURE
  return NULL;
}
