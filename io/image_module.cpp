#include "io/image_module.h"

#include <dlfcn.h>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {
namespace {

constexpr const char* kModule = "rbvh_images.so";

}  // namespace

const ImageModule& image_module(const std::string& path) {
  static const ImageModule* const module = [&] {
    const auto fail = [&](const std::string& why) {
      throw Error(ErrorKind::kFailure, path,
                  std::string("needs ") + kModule + ", which cannot be loaded (" + why +
                      "); install rbvh with it, and Debian's libopenimageio2.4");
    };
    // By name: it lies where the RUNPATH of this object leads. dlmopen, since what AddressSanitizer puts in
    // place of dlopen would search its own.
    void* const library = ::dlmopen(LM_ID_BASE, kModule, RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) fail(::dlerror());
    const auto entry = reinterpret_cast<decltype(&rbvh_image_module)>(::dlsym(library, "rbvh_image_module"));
    if (entry == nullptr) fail(::dlerror());
    const ImageModule* const found = entry();
    if (found->version != std::string_view(RBVH_VERSION))
      fail("it is of version " + std::string(found->version) + ", not " RBVH_VERSION);
    return found;
  }();
  return *module;
}

std::vector<unsigned char> encode_image(const char* format, const ImageSpec& spec, const void* pixels,
                                        const std::string& path) {
  std::vector<unsigned char> bytes;
  const std::string fault = image_module(path).encode(format, spec, pixels, thread_count(), bytes);
  if (!fault.empty()) throw Error(ErrorKind::kFailure, path, "the image cannot be written: " + fault);
  return bytes;
}

}  // namespace rbvh
