// One object with a picture on it, as files of several formats.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "io/png.h"
#include "tests/scan_bytes.h"

namespace rbvh {

/// A ball of six charts, whose vertices are shared across their borders; its picture has a chart for each,
/// checkered and shaded from one corner to the other.
struct TexturedBall {
  static constexpr std::uint32_t kCell = 64, kWidth = 3 * kCell, kHeight = 2 * kCell;

  std::vector<Vec3f> vertices;  ///< unit, so that they are the normals, too
  std::vector<std::array<float, 2>> places;
  struct Corner {
    std::uint32_t vertex, place;
  };
  std::vector<std::array<Corner, 4>> quads;

  explicit TexturedBall(int side = 12) {
    std::map<std::array<int, 3>, std::uint32_t> known;
    for (int chart = 0; chart < 6; ++chart)
      for (int j = 0; j < side; ++j)
        for (int i = 0; i < side; ++i) {
          std::array<Corner, 4> quad;
          for (int c = 0; c < 4; ++c) {
            const int x = i + (c == 1 || c == 2), y = j + (c > 1);
            std::array<int, 3> at{};
            const auto axis = static_cast<std::size_t>(chart / 2);
            at[axis] = chart % 2 == 0 ? side : -side;
            at[(axis + 1) % 3] = chart % 2 == 0 ? 2 * x - side : side - 2 * x;
            at[(axis + 2) % 3] = 2 * y - side;
            const auto [vertex, is_new] = known.try_emplace(at, static_cast<std::uint32_t>(vertices.size()));
            if (is_new)
              vertices.push_back(normalized(
                  Vec3f{static_cast<float>(at[0]), static_cast<float>(at[1]), static_cast<float>(at[2])}));
            const float inside = 1.0f / kCell;  // a texel between charts
            const auto along = [&](int k) {
              return inside + (1 - 2 * inside) * static_cast<float>(k) / static_cast<float>(side);
            };
            quad[static_cast<std::size_t>(c)] = {vertex->second, static_cast<std::uint32_t>(places.size())};
            places.push_back({(static_cast<float>(chart % 3) + along(x)) / 3,
                              (static_cast<float>(chart / 3) + along(y)) / 2});
          }
          quads.push_back(quad);
        }
  }

  static std::vector<std::uint8_t> pixels() {
    std::vector<std::uint8_t> rgb;
    for (std::uint32_t y = 0; y < kHeight; ++y)
      for (std::uint32_t x = 0; x < kWidth; ++x) {
        const bool dark = (x / 8 + y / 8) % 2 == 0;
        const std::uint32_t chart = x / kCell + 3 * (y / kCell);
        const auto shade = [&](std::uint32_t v) { return static_cast<std::uint8_t>(dark ? v / 4 : v); };
        rgb.insert(rgb.end(),
                   {shade(80 + 2 * (x % kCell)), shade(255 - 2 * (y % kCell)), shade(40 + 40 * chart)});
      }
    return rgb;
  }
  static std::string png() {
    const std::vector<std::uint8_t> rgb = pixels();
    const std::vector<std::byte> bytes = encode_png(kWidth, kHeight, 3, rgb, true);
    return {reinterpret_cast<const char*>(bytes.data()), bytes.size()};
  }

  std::string obj(const std::string& library = "ball.mtl") const {
    std::string text = "mtllib " + library + "\n";
    for (const Vec3f& p : vertices) text += "v" + words({p.x, p.y, p.z}) + "\n";
    for (const Vec3f& n : vertices) text += "vn" + words({n.x, n.y, n.z}) + "\n";
    for (const auto& uv : places) text += "vt" + words({uv[0], uv[1]}) + "\n";
    text += "usemtl skin\n";
    for (const auto& quad : quads) {
      text += "f";
      for (const Corner& c : quad) {
        const std::string v = std::to_string(c.vertex + 1);
        text += " " + v + "/" + std::to_string(c.place + 1) + "/" + v;
      }
      text += "\n";
    }
    return text;
  }
  static std::string mtl(const std::string& image = "ball.png") {
    return "newmtl skin\nKd 1 1 1\nmap_Kd " + image + "\n";
  }

  std::string ply(const std::string& image = "ball.png") const {
    std::string text = "ply\nformat ascii 1.0\ncomment TextureFile " + image + "\nelement vertex " +
                       std::to_string(vertices.size()) +
                       "\nproperty float x\nproperty float y\nproperty float z\nproperty float nx\n"
                       "property float ny\nproperty float nz\nelement face " +
                       std::to_string(quads.size()) +
                       "\nproperty list uchar int vertex_indices\nproperty list uchar float texcoord\n"
                       "property int texnumber\nend_header\n";
    for (const Vec3f& p : vertices) text += words({p.x, p.y, p.z, p.x, p.y, p.z}) + "\n";
    for (const auto& quad : quads) {
      text += "4";
      for (const Corner& c : quad) text += " " + std::to_string(c.vertex);
      text += " 8";
      for (const Corner& c : quad) text += words({places[c.place][0], places[c.place][1]});
      text += " 0\n";
    }
    return text;
  }

  /// With the image inside. `look`: more of the material's baseColorTexture and the textures' sampler.
  std::string glb(const nlohmann::json& sampler = nullptr, const nlohmann::json& of_texture = nullptr) const {
    using Json = nlohmann::json;
    std::string positions, uvs, indices;
    std::uint32_t count = 0;
    for (const auto& quad : quads) {
      for (const Corner& c : quad) {
        const Vec3f p = vertices[c.vertex];
        positions += raw(p.x) + raw(p.y) + raw(p.z);
        uvs += raw(places[c.place][0]) + raw(1 - places[c.place][1]);
      }
      for (const std::uint32_t i : {0u, 1u, 2u, 0u, 2u, 3u}) indices += raw(count + i);
      count += 4;
    }
    std::string binary;
    Json views = Json::array();
    const auto view = [&](const std::string& bytes) {
      views.push_back({{"buffer", 0}, {"byteOffset", binary.size()}, {"byteLength", bytes.size()}});
      binary += bytes;
      binary.resize((binary.size() + 3) / 4 * 4, '\0');
      return views.size() - 1;
    };
    const auto accessor = [&](const std::string& bytes, std::size_t rows, const char* type, int component) {
      return Json{{"bufferView", view(bytes)}, {"count", rows}, {"type", type}, {"componentType", component}};
    };
    Json root = {{"asset", {{"version", "2.0"}}}};
    root["accessors"] =
        Json::array({accessor(positions, count, "VEC3", 5126), accessor(uvs, count, "VEC2", 5126),
                     accessor(indices, 6 * quads.size(), "SCALAR", 5125)});
    root["images"] = Json::array({{{"bufferView", view(png())}, {"mimeType", "image/png"}}});
    root["bufferViews"] = views;
    root["buffers"] = Json::array({{{"byteLength", binary.size()}}});
    root["textures"] = Json::array({{{"source", 0}}});
    if (!sampler.is_null()) root["samplers"] = Json::array({sampler});
    if (!sampler.is_null()) root["textures"][0]["sampler"] = 0;
    Json shown = {{"index", 0}};
    if (!of_texture.is_null()) shown.update(of_texture);
    root["materials"] = Json::array({{{"pbrMetallicRoughness", {{"baseColorTexture", shown}}}}});
    Json primitive = {
        {"attributes", {{"POSITION", 0}, {"NORMAL", 0}, {"TEXCOORD_0", 1}}}, {"indices", 2}, {"material", 0}};
    root["meshes"] = Json::array({Json{{"primitives", Json::array({primitive})}}});
    root["nodes"] = Json::array({{{"mesh", 0}}});
    std::string text = root.dump();
    text.resize((text.size() + 3) / 4 * 4, ' ');
    const auto length = [](const std::string& s) { return raw(static_cast<std::uint32_t>(s.size())); };
    const std::string chunks =
        length(text) + "JSON" + text + length(binary) + std::string("BIN\0", 4) + binary;
    return "glTF" + raw(std::uint32_t{2}) + raw(static_cast<std::uint32_t>(12 + chunks.size())) + chunks;
  }

 private:
  static std::string words(std::initializer_list<float> values) {
    std::string text;
    for (const float value : values) {
      char word[32];
      std::snprintf(word, sizeof word, " %.9g", static_cast<double>(value));
      text += word;
    }
    return text;
  }
};

}  // namespace rbvh
