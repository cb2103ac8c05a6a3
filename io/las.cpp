#include "io/las.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <optional>
#include <utility>

#include "io/colors.h"
#include "pipeline/base/error.h"

namespace rbvh {
namespace {

/// What a point format has beside position, intensity and classification, which all of them have.
struct PointFormat {
  std::size_t size;       ///< bytes, without extra ones
  std::size_t color = 0;  ///< where red, green and blue begin; 0: none
  bool has_time = false, has_infrared = false, has_waveform = false;
  bool is_wide = false;  ///< of LAS 1.4: flags and classification have a byte each
};
constexpr PointFormat kFormats[] = {
    {20},
    {28, 0, true},
    {26, 20},
    {34, 28, true},
    {57, 0, true, false, true},
    {63, 28, true, false, true},
    {30, 0, true, false, false, true},
    {36, 30, true, false, false, true},
    {38, 30, true, true, false, true},
    {59, 0, true, false, true, true},
    {67, 30, true, true, true, true},
};

constexpr std::size_t kHeader = 227;       ///< bytes, of LAS 1.0 to 1.2
constexpr std::size_t kLongHeader = 375;   ///< of LAS 1.4
constexpr std::size_t kRecordHeader = 54;  ///< of a variable length record
constexpr std::uint64_t kMostPoints = UINT32_MAX - 1;

class LasReader {
 public:
  LasReader(std::string_view bytes, const std::string& file) : bytes_(bytes), file_(file) {}

  RawScan read() {
    read_header();
    refuse_degrees();
    choose_count();
    read_points();
    finish_colors();
    note_lost();
    return std::move(scan_);
  }

 private:
  template <class T>
  T load(std::size_t at) const {
    T value;
    std::memcpy(&value, bytes_.data() + at, sizeof(T));
    return value;
  }
  Vec3d load_vector(std::size_t at) const {
    return {load<double>(at), load<double>(at + 8), load<double>(at + 16)};
  }
  [[noreturn]] void fail(std::size_t byte, const std::string& what) const {
    throw Error(ErrorKind::kInput, file_, FilePlace{"byte", byte}, what);
  }

  void read_header() {
    if (!is_las(bytes_)) fail(0, "does not begin with LASF");
    if (bytes_.size() < kHeader) fail(bytes_.size(), "the file is cut inside its header");
    const int major = load<std::uint8_t>(24);
    minor_ = load<std::uint8_t>(25);
    if (major != 1 || minor_ > 4)
      fail(24, "is LAS " + std::to_string(major) + "." + std::to_string(minor_) + "; 1.0 to 1.4 are read");
    const unsigned number = load<std::uint8_t>(104);
    if (is_compressed_las(bytes_)) throw Error(ErrorKind::kInput, file_, "is compressed (LAZ or COPC)");
    if (number >= std::size(kFormats))
      fail(104, "the point format " + std::to_string(number) + " is not known");
    format_ = kFormats[number];
    header_size_ = load<std::uint16_t>(94);
    data_ = load<std::uint32_t>(96);
    record_ = load<std::uint16_t>(105);
    scale_ = load_vector(131);
    offset_ = load_vector(155);
    if (header_size_ < kHeader || data_ < header_size_) fail(94, "the header's sizes contradict each other");
    if (data_ > bytes_.size()) fail(bytes_.size(), "the file is cut before its first point");
    if (record_ < format_.size)
      fail(105, "points of format " + std::to_string(number) + " take " + std::to_string(format_.size) +
                    " bytes, and the header says " + std::to_string(record_));
    if (!is_finite(scale_) || !is_finite(offset_) || scale_.x == 0 || scale_.y == 0 || scale_.z == 0)
      fail(131, "the coordinates' scale is 0, or scale or offset are not finite");
  }

  bool is_long() const { return minor_ >= 4 && header_size_ >= kLongHeader; }

  /// Calls `see` with the user, number and bytes of each variable length record.
  template <class See>
  void each_record(const See& see) const {
    const auto count = load<std::uint32_t>(100);
    std::size_t at = header_size_;
    for (std::uint32_t i = 0; i < count && at + kRecordHeader <= data_; ++i) {
      const std::size_t length = load<std::uint16_t>(at + 20), body = at + kRecordHeader;
      if (body + length > data_) return;
      see(std::string_view(bytes_.data() + at + 2, 16), load<std::uint16_t>(at + 18), body, length);
      at = body + length;
    }
  }

  /// Longitude, latitude and metres are no space to measure in.
  void refuse_degrees() const {
    constexpr std::uint16_t kGeoKeys = 34735, kWkt = 2112, kModelType = 1024, kGeographic = 2;
    bool degrees = false;
    each_record([&](std::string_view user, std::uint16_t number, std::size_t at, std::size_t length) {
      if (!user.starts_with("LASF_Projection")) return;
      if (number == kGeoKeys) {  // four words each: key, where its value is (0: here), how many, the value
        for (std::size_t key = 8; key + 8 <= length; key += 8)
          degrees |= load<std::uint16_t>(at + key) == kModelType && load<std::uint16_t>(at + key + 2) == 0 &&
                     load<std::uint16_t>(at + key + 6) == kGeographic;
      } else if (number == kWkt) {
        const std::string_view text = bytes_.substr(at, length);
        const auto has = [&](std::string_view word) { return text.find(word) != std::string_view::npos; };
        degrees |=
            (has("GEOGCS[") || has("GEOGCRS[")) && !has("PROJCS[") && !has("PROJCRS[") && !has("GEOCCS[");
      }
    });
    if (degrees)
      throw Error(
          ErrorKind::kInput, file_,
          "its coordinates are longitude and latitude in degrees; project them first, to UTM for example");
  }

  /// LAS 1.4 has two counts, of which the old one may be 0. The bytes that are there have the last word.
  void choose_count() {
    const std::uint64_t old_count = load<std::uint32_t>(107);
    const std::uint64_t new_count = is_long() ? load<std::uint64_t>(247) : 0;
    std::uint64_t end = bytes_.size();
    const auto stop_at = [&](std::uint64_t start) {
      if (start >= data_ && start < end) end = start;
    };
    const bool has_waveforms_inside = minor_ >= 3 && header_size_ >= 235 && (load<std::uint16_t>(6) & 2u);
    if (has_waveforms_inside) stop_at(load<std::uint64_t>(227));
    if (is_long() && load<std::uint32_t>(243) > 0) stop_at(load<std::uint64_t>(235));
    const std::uint64_t room = (end - data_) / record_;

    count_ = new_count ? new_count : old_count;
    if (new_count && old_count && new_count != old_count) {
      if (new_count > room && old_count <= room) count_ = old_count;
      scan_.notes.push_back("the header has two counts of points, " + std::to_string(old_count) + " and " +
                            std::to_string(new_count) + "; " + std::to_string(count_) + " were read");
    }
    if (count_ == 0)
      throw Error(ErrorKind::kInput, file_,
                  room == 0 ? "has no points"
                            : "the header says that there are no points, and there are bytes for " +
                                  std::to_string(room) + ": whoever wrote it was interrupted");
    if (count_ > room)
      fail(bytes_.size(), "the header promises " + std::to_string(count_) +
                              " points, but there are bytes for " + std::to_string(room) +
                              " at most: the file is cut or its counts are wrong");
    if (count_ > kMostPoints) fail(247, "has " + std::to_string(count_) + " points; 4294967294 is the limit");
    const std::string_view rest = bytes_.substr(data_ + count_ * record_, end - data_ - count_ * record_);
    if (std::any_of(rest.begin(), rest.end(), [](char c) { return c != 0; }))
      scan_.notes.push_back(std::to_string(rest.size()) + " bytes follow the last point and were ignored");
  }

  void read_points() {
    const std::size_t count = static_cast<std::size_t>(count_);
    scan_.positions.reserve(count);
    std::vector<float> intensities, classes;
    intensities.reserve(count);
    classes.reserve(count);
    if (format_.color) colors_.reserve(count);
    std::size_t withheld = 0;
    for (std::size_t i = 0, at = data_; i < count; ++i, at += record_) {
      const auto flags = load<std::uint8_t>(at + 15);  // and the class, in old formats
      if (flags & withheld_bit()) {
        ++withheld;
        continue;
      }
      scan_.positions.push_back({load<std::int32_t>(at) * scale_.x + offset_.x,
                                 load<std::int32_t>(at + 4) * scale_.y + offset_.y,
                                 load<std::int32_t>(at + 8) * scale_.z + offset_.z});
      intensities.push_back(load<std::uint16_t>(at + 12));
      classes.push_back(format_.is_wide ? load<std::uint8_t>(at + 16)
                        : minor_ == 0   ? flags
                                        : static_cast<std::uint8_t>(flags & 0x1fu));
      if (!format_.color) continue;
      const std::size_t color = at + format_.color;
      colors_.push_back(
          {load<std::uint16_t>(color), load<std::uint16_t>(color + 2), load<std::uint16_t>(color + 4)});
    }
    if (withheld == count) throw Error(ErrorKind::kInput, file_, "all its points are marked as withheld");
    if (withheld > 0)
      scan_.notes.push_back(std::to_string(withheld) + " points are marked as withheld and were left out");
    scan_.properties.push_back({"intensity", std::move(intensities)});
    scan_.properties.push_back({"classification", std::move(classes)});
  }

  /// Of the byte 15. In LAS 1.0 all of it is the class.
  unsigned withheld_bit() const { return format_.is_wide ? 4u : minor_ == 0 ? 0u : 0x80u; }

  /// Many programs write bytes into the 16-bit fields.
  void finish_colors() {
    std::uint16_t largest = 0;
    for (const auto& color : colors_)
      for (const std::uint16_t channel : color) largest = std::max(largest, channel);
    if (colors_.empty()) return;
    if (largest == 0) {
      scan_.notes.push_back("all colours are 0 and were left out");
      return;
    }
    if (largest <= 255)
      scan_.notes.push_back("no colour is above 255: they are taken for values of 8 bits in place of 16");
    const double scale = largest <= 255 ? 1.0 : 255.0 / 65535.0;
    scan_.colors.reserve(colors_.size());
    for (const auto& c : colors_)
      scan_.colors.push_back(
          {to_color_byte(c[0] * scale), to_color_byte(c[1] * scale), to_color_byte(c[2] * scale)});
  }

  void note_lost() {
    std::string lost = "returns, scan angles, user data and source ids";
    if (format_.has_time) lost += ", GPS times";
    if (format_.has_infrared) lost += ", near infrared";
    if (format_.has_waveform) lost += ", waveforms";
    if (record_ > format_.size)
      lost += ", " + std::to_string(record_ - format_.size) + " extra bytes a point";
    scan_.notes.push_back(lost + " are not kept");
  }

  std::string_view bytes_;
  const std::string& file_;
  PointFormat format_{};
  int minor_ = 0;
  std::size_t header_size_ = 0, data_ = 0, record_ = 0;
  std::uint64_t count_ = 0;
  Vec3d scale_, offset_;
  std::vector<std::array<std::uint16_t, 3>> colors_;
  RawScan scan_;
};

}  // namespace

bool is_las(std::string_view bytes) { return bytes.starts_with("LASF"); }

bool is_compressed_las(std::string_view bytes) {
  constexpr std::size_t kFormat = 104;
  return bytes.size() > kFormat && (static_cast<std::uint8_t>(bytes[kFormat]) & 0xc0u) != 0;
}

RawScan read_las(std::string_view bytes, const std::string& file) { return LasReader(bytes, file).read(); }

}  // namespace rbvh
