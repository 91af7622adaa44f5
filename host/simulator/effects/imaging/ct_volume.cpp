#include "host/simulator/effects/imaging/ct_volume.h"

#include <fmt/format.h>

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <charconv>
#include <cmath>
#include <map>
#include <string_view>

#include "host/support/error.h"
#include "host/support/fnv1a.h"
#include "host/support/input_file.h"
#include "host/support/printable_text.h"

namespace torquer::effects {

namespace {

static_assert(std::endian::native == std::endian::little,
              "the values of the file are little-endian");

constexpr const char* kRemedy =
    "save the scan as an uncompressed MetaImage (.mha) of 16-bit Hounsfield units, as "
    "torquer-import does";
constexpr std::size_t kMostHeaderBytes = 16384;
constexpr int kMostVoxelsAlongAxis = 8192;
constexpr double kFinestMm = 0.02;
constexpr double kCoarsestMm = 10;
constexpr double kFarthestMm = 1e5;

// Fields of a header, up to the name of the data.
class Header {
 public:
  explicit Header(const InputFile& file) : path_(file.path()) {
    std::string text(kMostHeaderBytes, '\0');
    text.resize(file.ReadAt(0, text.data(), text.size()));
    std::size_t at = 0;
    while (!Has("ElementDataFile")) {
      const std::size_t end = text.find('\n', at);
      if (end == std::string::npos) {
        throw UserError(fmt::format("{}: has no field ElementDataFile in its first {} bytes; {}",
                                    path_, kMostHeaderBytes, kRemedy));
      }
      Add(std::string_view(text).substr(at, end - at));
      at = end + 1;
    }
    bytes_ = at;
  }

  std::size_t bytes() const { return bytes_; }
  bool Has(const std::string& field) const { return fields_.contains(field); }
  const std::string& Text(const std::string& field) const {
    const auto found = fields_.find(field);
    if (found == fields_.end()) {
      throw UserError(fmt::format("{}: field {} is missing; {}", path_, field, kRemedy));
    }
    return found->second;
  }
  [[noreturn]] void Refuse(const std::string& field, const std::string& problem) const {
    constexpr std::size_t kShownBytes = 60;
    throw UserError(fmt::format("{}: field {} is '{}': {}; {}", path_, field,
                                Printable(Text(field), kShownBytes), problem, kRemedy));
  }
  // A field that may be missing must have this value.
  void Expect(const std::string& field, const std::string& value, const char* otherwise) const {
    if (Has(field) && Text(field) != value) Refuse(field, otherwise);
  }
  template <class Number, std::size_t kCount>
  std::array<Number, kCount> Numbers(const std::string& field) const {
    std::array<Number, kCount> numbers{};
    const std::string& text = Text(field);
    const char* at = text.data();
    const char* const end = at + text.size();
    for (Number& number : numbers) {
      while (at < end && *at == ' ') ++at;
      const auto [next, error] = std::from_chars(at, end, number);
      if (error != std::errc()) Refuse(field, fmt::format("it needs {} numbers", kCount));
      at = next;
    }
    if (at != end) Refuse(field, fmt::format("it needs {} numbers", kCount));
    return numbers;
  }

 private:
  void Add(std::string_view line) {
    const std::size_t equals = line.find('=');
    if (equals == std::string_view::npos) {
      throw UserError(fmt::format("{}: does not begin as a MetaImage file; {}", path_, kRemedy));
    }
    fields_.emplace(Trimmed(line.substr(0, equals)), Trimmed(line.substr(equals + 1)));
  }
  static std::string_view Trimmed(std::string_view text) {
    constexpr std::string_view kSpace = " \t\r";
    const std::size_t first = text.find_first_not_of(kSpace);
    if (first == std::string_view::npos) return {};
    return text.substr(first, text.find_last_not_of(kSpace) - first + 1);
  }

  std::string path_;
  std::map<std::string, std::string> fields_;
  std::size_t bytes_ = 0;
};

void CheckKind(const Header& header) {
  if (header.Text("NDims") != "3") header.Refuse("NDims", "a scan has 3 dimensions");
  if (header.Text("ElementType") != "MET_SHORT") {
    header.Refuse("ElementType", "the values must be MET_SHORT");
  }
  if (header.Text("ElementDataFile") != "LOCAL") {
    header.Refuse("ElementDataFile", "the values must follow in the same file (LOCAL)");
  }
  header.Expect("ElementNumberOfChannels", "1", "a scan has one value in each voxel");
  header.Expect("BinaryData", "True", "the values must be binary");
  header.Expect("CompressedData", "False", "the values must not be compressed");
  for (const char* order : {"BinaryDataByteOrderMSB", "ElementByteOrderMSB"}) {
    header.Expect(order, "False", "the values must be little-endian");
  }
  for (const char* other : {"Rotation", "Orientation", "Position", "Origin", "HeaderSize"}) {
    if (header.Has(other)) header.Refuse(other, "only TransformMatrix and Offset give the place");
  }
}

void ReadSize(const Header& header, CtVolume& volume) {
  volume.size = header.Numbers<int, 3>("DimSize");
  std::int64_t voxels = 1;
  for (const int count : volume.size) {
    if (count < 2 || count > kMostVoxelsAlongAxis) {
      header.Refuse("DimSize", fmt::format("each must be 2 to {}", kMostVoxelsAlongAxis));
    }
    voxels *= count;
  }
  if (voxels > kMostCtVoxels) {
    header.Refuse("DimSize", fmt::format("these are {} voxels, and at most {} are read; crop the "
                                         "scan, or halve its resolution",
                                         voxels, kMostCtVoxels));
  }
}

// MetaImage lists the directions of the columns, rows and slices one after another.
void ReadPlace(const Header& header, const vessel::PatientAxes& axes, CtVolume& volume) {
  const auto spacing = header.Numbers<double, 3>("ElementSpacing");
  const auto turn = header.Numbers<double, 9>("TransformMatrix");
  const auto offset = header.Numbers<double, 3>("Offset");
  for (const double mm : spacing) {
    if (mm >= kFinestMm && mm <= kCoarsestMm) continue;
    header.Refuse("ElementSpacing",
                  fmt::format("each must be {:g} to {:g} mm", kFinestMm, kCoarsestMm));
  }
  for (const double mm : offset) {
    if (!(std::abs(mm) <= kFarthestMm)) {
      header.Refuse("Offset", fmt::format("each must be within {:g} mm", kFarthestMm));
    }
  }
  Eigen::Matrix3d to_vessel;
  to_vessel << axes.left, axes.posterior, axes.superior;
  const Eigen::Matrix3d directions = Eigen::Map<const Eigen::Matrix3d>(turn.data());
  constexpr double kLeastVolume = 0.5;  // of the cell of unit directions; a tilted gantry keeps 0.8
  const bool is_unit =
      ((directions.colwise().norm().array() - 1).abs() < 1e-3).all() && directions.allFinite();
  if (!is_unit || std::abs(directions.determinant()) < kLeastVolume) {
    header.Refuse("TransformMatrix", "it needs three unit directions that span a volume");
  }
  volume.step_mm = to_vessel * directions * Eigen::Vector3d(spacing.data()).asDiagonal();
  volume.first_mm = to_vessel * Eigen::Vector3d(offset.data());
}

}  // namespace

CtVolume ReadCtVolume(const std::string& path, const vessel::PatientAxes& axes) {
  const InputFile file(path, "check the path and its permissions");
  const Header header(file);
  CtVolume volume;
  CheckKind(header);
  ReadSize(header, volume);
  ReadPlace(header, axes, volume);
  const std::int64_t voxels =
      std::int64_t{volume.size[0]} * std::int64_t{volume.size[1]} * std::int64_t{volume.size[2]};
  const auto begin = static_cast<std::int64_t>(header.bytes());
  const std::int64_t wanted = begin + 2 * voxels;
  if (file.bytes() != wanted) {
    throw UserError(
        fmt::format("{}: has {} bytes instead of {} by its field DimSize; copy it again", path,
                    file.bytes(), wanted));
  }
  volume.values.resize(static_cast<std::size_t>(voxels));
  auto* const bytes = reinterpret_cast<char*>(volume.values.data());
  const std::size_t size = 2 * volume.values.size();
  if (file.ReadAt(begin, bytes, size) != size) {
    throw UserError(fmt::format("{}: became shorter while it was read; copy it again", path));
  }
  std::string head(header.bytes(), '\0');
  file.ReadAt(0, head.data(), head.size());
  volume.file_hash = Fnv1a({bytes, size}, Fnv1a(head));
  return volume;
}

}  // namespace torquer::effects
