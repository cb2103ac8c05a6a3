#include "io/las.h"

#include <algorithm>
#include <cstring>
#include <memory>
#include <utility>

#include "io/colors.h"
#include "io/input_file.h"
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
constexpr std::size_t kPiecePoints = 1 << 18;
constexpr std::uint64_t kMostHead = std::uint64_t{1}
                                    << 28;  ///< bytes before the first point, of a large file

/// Reads a header, then points.
class LasReader {
 public:
  /// `bytes`: of a file of `size`, at least those before the first point.
  LasReader(std::string_view bytes, std::uint64_t size, const std::string& file)
      : bytes_(bytes), size_(size), file_(file) {
    read_header();
    refuse_degrees();
    choose_count();
  }

  std::uint64_t first_point() const { return data_; }
  std::size_t point_bytes() const { return record_; }
  std::uint64_t points() const { return count_; }
  /// Bytes after the last point that nothing claims.
  std::uint64_t rest() const { return end_ - data_ - count_ * record_; }
  bool has_colors() const { return format_.color != 0; }

  std::uint16_t largest_color(std::string_view points) const {
    std::uint16_t largest = 0;
    for (std::size_t at = 0; at < points.size(); at += record_)
      for (std::size_t channel = 0; channel < 3 && !is_withheld(points, at); ++channel)
        largest = std::max(largest, load<std::uint16_t>(points, at + format_.color + 2 * channel));
    return largest;
  }

  /// `largest`: the largest_color() of all points.
  RawScan read_points(std::string_view points, std::uint16_t largest) {
    RawScan scan;
    std::vector<float> intensities, classes;
    // Many programs write bytes into the 16-bit fields.
    const double scale = largest <= 255 ? 1.0 : 255.0 / 65535.0;
    for (std::size_t at = 0; at < points.size(); at += record_) {
      if (is_withheld(points, at)) {
        ++withheld_;
        continue;
      }
      scan.positions.push_back({load<std::int32_t>(points, at) * scale_.x + offset_.x,
                                load<std::int32_t>(points, at + 4) * scale_.y + offset_.y,
                                load<std::int32_t>(points, at + 8) * scale_.z + offset_.z});
      intensities.push_back(load<std::uint16_t>(points, at + 12));
      const auto flags = load<std::uint8_t>(points, at + 15);  // and the class, in old formats
      classes.push_back(format_.is_wide ? load<std::uint8_t>(points, at + 16)
                        : minor_ == 0   ? flags
                                        : static_cast<std::uint8_t>(flags & 0x1fu));
      if (largest == 0) continue;
      Color8& color = scan.colors.emplace_back();
      for (std::size_t channel = 0; channel < 3; ++channel)
        color[channel] = to_color_byte(load<std::uint16_t>(points, at + format_.color + 2 * channel) * scale);
    }
    scan.properties.push_back({"intensity", std::move(intensities)});
    scan.properties.push_back({"classification", std::move(classes)});
    return scan;
  }

  /// When all points are read. `has_rest`: a byte of rest() is not 0.
  std::vector<std::string> finish(std::uint16_t largest, bool has_rest) {
    if (withheld_ == count_) throw Error(ErrorKind::kInput, file_, "all its points are marked as withheld");
    if (has_rest) notes_.push_back(std::to_string(rest()) + " bytes follow the last point and were ignored");
    if (withheld_ > 0)
      notes_.push_back(std::to_string(withheld_) + " points are marked as withheld and were left out");
    if (has_colors() && largest == 0) notes_.push_back("all colours are 0 and were left out");
    if (has_colors() && largest > 0 && largest <= 255)
      notes_.push_back("no colour is above 255: they are taken for values of 8 bits in place of 16");
    note_lost();
    return std::move(notes_);
  }

 private:
  template <class T>
  static T load(std::string_view bytes, std::size_t at) {
    T value;
    std::memcpy(&value, bytes.data() + at, sizeof(T));
    return value;
  }
  template <class T>
  T load(std::size_t at) const {
    return load<T>(bytes_, at);
  }
  Vec3d load_vector(std::size_t at) const {
    return {load<double>(at), load<double>(at + 8), load<double>(at + 16)};
  }
  [[noreturn]] void fail(std::size_t byte, const std::string& what) const {
    throw Error(ErrorKind::kInput, file_, FilePlace{"byte", byte}, what);
  }

  void read_header() {
    if (!is_las(bytes_)) fail(0, "does not begin with LASF");
    if (bytes_.size() < kHeader) fail(size_, "the file is cut inside its header");
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
    if (data_ > size_) fail(size_, "the file is cut before its first point");
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
    end_ = size_;
    const auto stop_at = [&](std::uint64_t start) {
      if (start >= data_ && start < end_) end_ = start;
    };
    const bool has_waveforms_inside = minor_ >= 3 && header_size_ >= 235 && (load<std::uint16_t>(6) & 2u);
    if (has_waveforms_inside) stop_at(load<std::uint64_t>(227));
    if (is_long() && load<std::uint32_t>(243) > 0) stop_at(load<std::uint64_t>(235));
    const std::uint64_t room = (end_ - data_) / record_;

    count_ = new_count ? new_count : old_count;
    if (new_count && old_count && new_count != old_count) {
      if (new_count > room && old_count <= room) count_ = old_count;
      notes_.push_back("the header has two counts of points, " + std::to_string(old_count) + " and " +
                       std::to_string(new_count) + "; " + std::to_string(count_) + " were read");
    }
    if (count_ == 0)
      throw Error(ErrorKind::kInput, file_,
                  room == 0 ? "has no points"
                            : "the header says that there are no points, and there are bytes for " +
                                  std::to_string(room) + ": whoever wrote it was interrupted");
    if (count_ > room)
      fail(size_, "the header promises " + std::to_string(count_) + " points, but there are bytes for " +
                      std::to_string(room) + " at most: the file is cut or its counts are wrong");
    if (count_ > kMostPoints) fail(247, "has " + std::to_string(count_) + " points; 4294967294 is the limit");
  }

  bool is_withheld(std::string_view points, std::size_t at) const {
    return (load<std::uint8_t>(points, at + 15) & withheld_bit()) != 0;
  }
  /// Of the byte 15. In LAS 1.0 all of it is the class.
  unsigned withheld_bit() const { return format_.is_wide ? 4u : minor_ == 0 ? 0u : 0x80u; }

  void note_lost() {
    std::string lost = "returns, scan angles, user data and source ids";
    if (format_.has_time) lost += ", GPS times";
    if (format_.has_infrared) lost += ", near infrared";
    if (format_.has_waveform) lost += ", waveforms";
    if (record_ > format_.size)
      lost += ", " + std::to_string(record_ - format_.size) + " extra bytes a point";
    notes_.push_back(lost + " are not kept");
  }

  std::string_view bytes_;
  std::uint64_t size_;
  const std::string& file_;
  PointFormat format_{};
  int minor_ = 0;
  std::size_t header_size_ = 0, data_ = 0, record_ = 0;
  std::uint64_t count_ = 0, end_ = 0, withheld_ = 0;
  Vec3d scale_, offset_;
  std::vector<std::string> notes_;
};

bool has_any(std::string_view bytes) {
  return std::any_of(bytes.begin(), bytes.end(), [](char c) { return c != 0; });
}

/// Calls visit() with piece after piece of what follows, of whole entries, until it returns false.
template <class Visit>
void for_each_piece(InputStream& in, std::uint64_t entries, std::size_t bytes, const Visit& visit) {
  std::string piece;
  while (entries > 0) {
    const auto count = static_cast<std::size_t>(std::min<std::uint64_t>(entries, kPiecePoints));
    piece.resize(count * bytes);
    if (in.read(std::as_writable_bytes(std::span(piece))) != piece.size())
      throw Error(ErrorKind::kInput, in.name(), "the file has become shorter while it was read");
    if (!visit(std::string_view(piece))) return;
    entries -= count;
  }
}

/// The bytes before the first point.
std::string read_head(InputStream& in) {
  std::string head(kLongHeader, '\0');
  head.resize(in.read(std::as_writable_bytes(std::span(head))));
  if (head.size() < kHeader) return head;
  std::uint32_t data = 0;
  std::memcpy(&data, head.data() + 96, sizeof data);
  if (data <= head.size() || data > in.file_bytes().value_or(0)) return head;
  if (data > kMostHead) throw Error(ErrorKind::kInput, in.name(), "has too many bytes before its points");
  const std::size_t had = head.size();
  head.resize(data);
  in.read(std::as_writable_bytes(std::span(head).subspan(had)));
  return head;
}

/// At the first of the points.
std::unique_ptr<InputStream> open_points(const std::string& path, std::uint64_t first) {
  auto in = std::make_unique<InputStream>(path);
  for_each_piece(*in, first, 1, [](std::string_view) { return true; });
  return in;
}

}  // namespace

bool is_las(std::string_view bytes) { return bytes.starts_with("LASF"); }

bool is_compressed_las(std::string_view bytes) {
  constexpr std::size_t kFormat = 104;
  return bytes.size() > kFormat && (static_cast<std::uint8_t>(bytes[kFormat]) & 0xc0u) != 0;
}

RawScan read_las(std::string_view bytes, const std::string& file) {
  LasReader reader(bytes, bytes.size(), file);
  const auto first = static_cast<std::size_t>(reader.first_point());
  const std::size_t size = static_cast<std::size_t>(reader.points()) * reader.point_bytes();
  const std::string_view points = bytes.substr(first, size);
  const std::uint16_t largest = reader.has_colors() ? reader.largest_color(points) : std::uint16_t{0};
  RawScan scan = reader.read_points(points, largest);
  scan.notes =
      reader.finish(largest, has_any(bytes.substr(first + size, static_cast<std::size_t>(reader.rest()))));
  return scan;
}

std::vector<std::string> read_las_in_pieces(const std::string& path,
                                            const std::function<void(RawScan&& piece)>& visit) {
  InputStream begin(path);
  const std::string name = begin.name(), head = read_head(begin);
  LasReader reader(head, begin.file_bytes().value_or(head.size()), name);
  std::uint16_t largest = 0;
  if (reader.has_colors())  // one above 255 tells what the others are
    for_each_piece(*open_points(path, reader.first_point()), reader.points(), reader.point_bytes(),
                   [&](std::string_view points) {
                     largest = std::max(largest, reader.largest_color(points));
                     return largest <= 255;
                   });
  const std::unique_ptr<InputStream> in = open_points(path, reader.first_point());
  for_each_piece(*in, reader.points(), reader.point_bytes(), [&](std::string_view points) {
    visit(reader.read_points(points, largest));
    return true;
  });
  bool has_rest = false;
  for_each_piece(*in, reader.rest(), 1,
                 [&](std::string_view bytes) { return !(has_rest |= has_any(bytes)); });
  return reader.finish(largest, has_rest);
}

}  // namespace rbvh
