#include <atomic>
#include <bit>
#include <cmath>
#include <fstream>
#include <numbers>
#include <system_error>

#include <unistd.h>

#include "core/check.h"
#include "core/error.h"
#include "core/file.h"
#include "core/half.h"
#include "shading/scattering_orders.h"
#include "storage/database_fields.h"
#include "storage/database_parser.h"
#include "storage/h5.h"
#include "storage/light_tables.h"
#include "storage/user_block.h"

namespace weft::storage {

static_assert(std::endian::native == std::endian::little, "files hold little-endian numbers");

namespace {

// Half precision is used where its rounding adds less than this share of the standard error.
constexpr double kRoundingShare = 0.1;

double root_mean_square(const std::vector<float>& values) {
  double sum = 0;
  for (const float value : values) {
    sum += static_cast<double>(value) * static_cast<double>(value);
  }
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

std::vector<std::uint16_t> halves_of(const std::vector<float>& values) {
  std::vector<std::uint16_t> halves(values.size());
  for (std::size_t i = 0; i < values.size(); ++i) {
    halves[i] = core::half_from_float(values[i]);
  }
  return halves;
}

double rounding_rms(const std::vector<float>& values, const std::vector<std::uint16_t>& halves) {
  double sum = 0;
  for (std::size_t i = 0; i < values.size(); ++i) {
    const float difference = core::float_from_half(halves[i]) - values[i];
    sum += static_cast<double>(difference) * static_cast<double>(difference);
  }
  return values.empty() ? 0 : std::sqrt(sum / static_cast<double>(values.size()));
}

// Of transfer, by what its rounding and its standard errors are.
bool are_halves_enough(double rounding, const std::vector<float>& errors) {
  return rounding <= kRoundingShare * root_mean_square(errors);
}

void round_to_halves(std::vector<float>& values) {
  for (float& value : values) {
    value = core::float_from_half(core::half_from_float(value));
  }
}

Extents extents_of(const FabricDatabase& db) {
  Extents extents;
  extents.set("materials", db.materials.size());
  extents.set("yarns", db.yarn_names.size());
  extents.set("threads", db.threads.size() / 3);
  extents.set("strands", db.strand_radius_mm.size());
  extents.set("points", db.points_mm.size() / 3);
  extents.set("segments", db.cell_of_segment.size());
  extents.set("cells", db.cell_paths.size());
  extents.set("coefficients", std::uint64_t{db.sh_order + 1} * (db.sh_order + 1));
  extents.set("bands", db.sh_order + 1);
  extents.set("resolution", db.visibility_resolution);
  extents.set("components", db.pca_components);
  extents.set("sg_count", db.sg_count);
  extents.set("order_groups", shading::order_groups(db.materials.size()));
  extents.set("order_counts", shading::order_counts(db.materials.size()));
  extents.set("low_coefficients", shading::shape_coefficients(db.sh_order));
  return extents;
}

// Puts every field into an image; checks its size against the schema first.
class FieldWriter {
 public:
  explicit FieldWriter(const FabricDatabase& db)
      : db_(db), extents_(extents_of(db)), image_(kUserBlockBytes) {
    if (db.sh_order > kMaxShOrder) {
      throw core::Error(core::Code::kDataLoss,
                        "dataset /iirtf/transfer cannot be written: its order is " +
                            std::to_string(db.sh_order) + " and the highest is " +
                            std::to_string(kMaxShOrder));
    }
    image_.add_attribute("/", "format", "weft fabric database, docs/database_format.md");
    image_.add_attribute("/", "schema", static_cast<double>(kDatabaseSchema));
    image_.add_attribute(
        "/", "conventions",
        "lengths mm, angles rad; directions are unit vectors that point away from the fibre; real "
        "orthonormal spherical harmonics without the Condon-Shortley phase, j = l (l + 1) + m");
    for (const GroupSpec& group : group_specs()) {
      image_.add_group(group.path, group.description);
    }
  }

  template <class T>
  void values(const char* path, const T* first) {
    const DatasetSpec& spec = dataset_spec(path);
    add(spec, spec.element, std::span<const T>(first, count_of(spec)));
  }

  template <class T>
  void array(const char* path, const std::vector<T>& data) {
    const DatasetSpec& spec = dataset_spec(path);
    add(spec, spec.element, std::span<const T>(data));
  }

  template <class T>
  void optional_array(const char* path, const std::vector<T>& data) {
    if (!data.empty()) {
      array(path, data);
    }
  }

  void optional_text(const char* path, const std::string& data) {
    if (!data.empty()) {
      text(path, data);
    }
  }

  template <class Member>
  void columns(const char* path, const std::vector<shading::FibreMaterial>& materials,
               Member member) {
    const DatasetSpec& spec = dataset_spec(path);
    if (materials.empty()) {
      refuse(spec, 0);
    }
    const std::size_t width = count_of(spec) / materials.size();
    std::vector<float> data;
    for (const shading::FibreMaterial& material : materials) {
      const float* first = member(material);
      data.insert(data.end(), first, first + width);
    }
    add(spec, spec.element, std::span<const float>(data));
  }

  void rounded(const char* path, const std::vector<float>& data) {
    const DatasetSpec& spec = dataset_spec(path);
    const std::vector<std::uint16_t> halves = halves_of(data);
    const double rounding = rounding_rms(data, halves);
    const bool is_error = &data == &db_.transfer_se;
    if (is_error || are_halves_enough(rounding, db_.transfer_se)) {
      add(spec, h5::Element::kF16, std::span<const std::uint16_t>(halves));
    } else {
      add(spec, h5::Element::kF32, std::span<const float>(data));
    }
    image_.add_attribute(path, "half_rounding_rms", rounding);
  }

  void derived(const char* path) {
    const DatasetSpec& spec = dataset_spec(path);
    add(spec, spec.element, std::span<const float>(derived_values(path)));
  }

  void texts(const char* path, const std::vector<std::string>& data) {
    const DatasetSpec& spec = dataset_spec(path);
    if (data.size() != count_of(spec) || data.empty()) {
      refuse(spec, data.size());
    }
    image_.add_text(path, data, spec.caption);
  }

  void text(const char* path, const std::string& data) { texts(path, {data}); }

  std::string finish() {
    image_.attach_scale("/materials/c_s", 2, "/materials/theta_o");
    image_.attach_scale("/sg/zonal", 0, "/sg/sharpness");
    image_.attach_scale("/visibility/ssdf/mean", 0, "/visibility/theta");
    image_.attach_scale("/visibility/ssdf/mean", 1, "/visibility/phi");
    image_.attach_scale("/visibility/ssdf/basis", 1, "/visibility/theta");
    image_.attach_scale("/visibility/ssdf/basis", 2, "/visibility/phi");
    return image_.finish();
  }

 private:
  [[nodiscard]] std::size_t count_of(const DatasetSpec& spec) const {
    std::size_t count = 1;
    for (const std::uint64_t extent : extents_.shape_of(spec)) {
      count *= extent;
    }
    return count;
  }

  [[noreturn]] void refuse(const DatasetSpec& spec, std::size_t size) const {
    throw core::Error(core::Code::kDataLoss,
                      std::string("dataset ") + spec.path + " cannot be written: it has " +
                          std::to_string(size) + " elements and its shape is " +
                          h5::to_string(extents_.shape_of(spec)));
  }

  template <class T>
  void add(const DatasetSpec& spec, h5::Element element, std::span<const T> data) {
    if (data.size() != count_of(spec) || data.empty()) {
      refuse(spec, data.size());
    }
    image_.add_array(spec.path, element, extents_.shape_of(spec), std::as_bytes(data),
                     spec.compress, spec.caption);
  }

  // Datasets that follow from the others, for people who read the file.
  [[nodiscard]] std::vector<float> derived_values(std::string_view path) const {
    if (path == "/sg/sharpness") {
      return zonal_sharpnesses();
    }
    if (path == "/sg/zonal") {
      return zonal_table(db_.sh_order);
    }
    if (path == "/visibility/ssg/axes") {
      return unrotated_sg_axes(db_.sg_count);
    }
    // 512 angles from -pi/2 to pi/2 with both ends; centres of rows and columns of directions.
    const bool is_theta_o = path == "/materials/theta_o";
    const std::size_t count = is_theta_o ? 512 : db_.visibility_resolution;
    const double extent = path == "/visibility/phi" ? 2 * std::numbers::pi : std::numbers::pi;
    std::vector<float> values(count);
    for (std::size_t i = 0; i < count; ++i) {
      const auto index = static_cast<double>(i);
      const auto n = static_cast<double>(count);
      values[i] =
          static_cast<float>(is_theta_o ? index * std::numbers::pi / (n - 1) - std::numbers::pi / 2
                                        : (index + 0.5) * extent / n);
    }
    return values;
  }

  const FabricDatabase& db_;
  Extents extents_;
  h5::ImageWriter image_;
};

// A file beside the one to be written, removed unless it was published.
class FileBeside {
 public:
  explicit FileBeside(const std::filesystem::path& path) {
    static std::atomic<std::uint64_t> counter{0};
    path_ = path.string() + "." + std::to_string(::getpid()) + "." + std::to_string(++counter) +
            ".part";
  }
  ~FileBeside() {
    std::error_code ignored;  // already renamed, or never made
    std::filesystem::remove(path_, ignored);
  }
  FileBeside(const FileBeside&) = delete;
  FileBeside& operator=(const FileBeside&) = delete;
  FileBeside(FileBeside&&) = delete;
  FileBeside& operator=(FileBeside&&) = delete;
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  std::filesystem::path path_;
};

}  // namespace

void round_as_written(FabricDatabase& database) {
  round_to_halves(database.transfer_se);
  if (are_halves_enough(rounding_rms(database.transfer, halves_of(database.transfer)),
                        database.transfer_se)) {
    round_to_halves(database.transfer);
  }
}

core::Digest write_database(const FabricDatabase& database, const std::filesystem::path& path) {
  return write_database(database, {}, path);
}

core::Digest write_database(const FabricDatabase& database, const Recolouring& recolouring,
                            const std::filesystem::path& path) {
  std::string file;
  {
    FieldWriter writer(database);
    exchange_fields(writer, database);
    exchange_recolouring(writer, recolouring);
    check_values(database);
    check_recolouring(database, recolouring);
    file = writer.finish();
  }
  UserBlock block;
  block.file_bytes = file.size();
  block.digest = core::digest_of(std::string_view(file).substr(kUserBlockBytes));
  file.replace(0, kUserBlockBytes, encode_user_block(block));

  const FileBeside beside(path);
  core::write_file_unsynced(beside.path(), file);
  // What we wrote ourselves is no stranger's: it is read here.
  file = std::string();
  file = core::read_file(beside.path(), block.file_bytes);
  CHECK(parse_database_here(file, beside.path().string()).digest == block.digest);
  core::publish_file(beside.path(), path);
  return block.digest;
}

}  // namespace weft::storage
