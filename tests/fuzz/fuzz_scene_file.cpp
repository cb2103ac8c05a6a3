// Arbitrary bytes as a scene.json.
#include <cmath>
#include <cstdlib>

#include "io/scene_file.h"
#include "pipeline/base/error.h"

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  try {
    const rbvh::SceneFile scene =
        rbvh::decode_scene({reinterpret_cast<const char*>(data), size}, "folder/fuzz.json");
    if (scene.instances.empty() || scene.instances.size() > rbvh::kMostSceneInstances) std::abort();
    for (const rbvh::SceneFile::Instance& instance : scene.instances)
      if (instance.object >= scene.objects.size() || !instance.to_world.is_finite() ||
          instance.to_world.determinant() == 0)
        std::abort();
  } catch (const rbvh::Error& error) {
    if (error.kind() != rbvh::ErrorKind::kInput) std::abort();
  }
  return 0;
}
