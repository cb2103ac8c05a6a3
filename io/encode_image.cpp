#include "io/encode_image.h"

#include <OpenImageIO/filesystem.h>

#include <memory>

#include "pipeline/base/error.h"
#include "pipeline/base/parallel_for.h"

namespace rbvh {

std::vector<unsigned char> encode_image(const char* format, const OIIO::ImageSpec& spec, OIIO::TypeDesc type,
                                        const void* pixels, const std::string& path) {
  const auto fail = [&](const std::string& why) {
    throw Error(ErrorKind::kFailure, path, "the image cannot be written: " + why);
  };
  OIIO::Filesystem::IOVecOutput memory;  // outlives the writer, which may still use it when it is destroyed
  const std::unique_ptr<OIIO::ImageOutput> out = OIIO::ImageOutput::create(format);
  if (out == nullptr) fail(OIIO::geterror());
  out->threads(thread_count());
  if (!out->set_ioproxy(&memory) || !out->open(std::string("image.") + format, spec) ||
      !out->write_image(type, pixels) || !out->close())
    fail(out->geterror());
  return memory.buffer();
}

}  // namespace rbvh
