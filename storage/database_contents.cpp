#include "storage/database_contents.h"

#include <algorithm>
#include <cstring>
#include <string>
#include <utility>
#include <vector>

#include "core/error.h"
#include "core/half.h"
#include "storage/database_fields.h"
#include "storage/light_tables.h"

namespace weft::storage {

namespace {

// Fills every field from a source.
class FieldReader {
 public:
  explicit FieldReader(DatasetSource& source) : source_(source) {}

  template <class T>
  void values(const char* path, T* first) {
    const DatasetSpec& spec = dataset_spec(path);
    const std::vector<T> data = take<T>(spec, info_of(spec));
    std::copy(data.begin(), data.end(), first);
  }

  template <class T>
  void array(const char* path, std::vector<T>& data) {
    const DatasetSpec& spec = dataset_spec(path);
    data = take<T>(spec, info_of(spec));
  }

  template <class T>
  void optional_array(const char* path, std::vector<T>& data) {
    if (source_.has(path)) {
      array(path, data);
    }
  }

  void optional_text(const char* path, std::string& data) {
    if (source_.has(path)) {
      text(path, data);
    }
  }

  template <class Member>
  void columns(const char* path, std::vector<shading::FibreMaterial>& materials, Member member) {
    const DatasetSpec& spec = dataset_spec(path);
    const std::vector<float> data = take<float>(spec, info_of(spec));
    materials.resize(extents_.at("materials"));
    const std::size_t width = data.size() / materials.size();
    for (std::size_t i = 0; i < materials.size(); ++i) {
      std::copy_n(data.data() + i * width, width, member(materials[i]));
    }
  }

  // Floats that may be stored as halves.
  void rounded(const char* path, std::vector<float>& data) {
    const DatasetSpec& spec = dataset_spec(path);
    const DatasetSource::Info info = info_of(spec, h5::Element::kF32);
    if (info.element == h5::Element::kF32) {
      data = take<float>(spec, info);
      return;
    }
    const std::vector<std::uint16_t> halves = take<std::uint16_t>(spec, info);
    data.resize(halves.size());
    for (std::size_t i = 0; i < halves.size(); ++i) {
      data[i] = core::float_from_half(halves[i]);
    }
  }

  void derived(const char* path) {
    std::vector<float> unused;
    array(path, unused);
  }

  void texts(const char* path, std::vector<std::string>& data) {
    const DatasetSpec& spec = dataset_spec(path);
    const DatasetSource::Info info = info_of(spec);
    const std::vector<char> characters = take<char>(spec, info);
    data.clear();
    for (std::uint64_t at = 0; at < characters.size(); at += info.element_bytes) {
      const char* const text = characters.data() + at;
      data.emplace_back(text, strnlen(text, info.element_bytes));
    }
  }

  void text(const char* path, std::string& data) {
    std::vector<std::string> one;
    texts(path, one);
    data = std::move(one.front());
  }

  [[nodiscard]] const Extents& extents() const { return extents_; }

 private:
  DatasetSource::Info info_of(const DatasetSpec& spec) { return info_of(spec, spec.element); }

  // Shape and element as the schema says; `other` is accepted as well.
  DatasetSource::Info info_of(const DatasetSpec& spec, h5::Element other) {
    DatasetSource::Info info = source_.info(spec.path);
    if (info.element != spec.element && info.element != other) {
      throw core::Error(core::Code::kDataLoss, std::string("dataset ") + spec.path +
                                                   " has elements " + h5::to_string(info.element) +
                                                   " where " + h5::to_string(spec.element) +
                                                   " was expected; fetch or make the file again");
    }
    extents_.bind(spec, info.shape);
    return info;
  }

  template <class T>
  std::vector<T> take(const DatasetSpec& spec, const DatasetSource::Info& info) {
    source_.admit(spec.path, info);
    std::vector<T> data(info.bytes / sizeof(T));
    source_.read(spec.path, info, std::as_writable_bytes(std::span<T>(data)));
    return data;
  }

  DatasetSource& source_;
  Extents extents_;
};

}  // namespace

FabricDatabase read_contents(DatasetSource& source) {
  return std::move(read_all_contents(source).database);
}

RecolourableDatabase read_all_contents(DatasetSource& source) {
  RecolourableDatabase contents;
  FabricDatabase& database = contents.database;
  FieldReader reader(source);
  exchange_fields(reader, database);
  exchange_recolouring(reader, contents.recolouring);
  const std::uint64_t bands = reader.extents().at("bands");
  if (bands > kMaxShOrder + 1 || bands * bands != reader.extents().at("coefficients")) {
    throw core::Error(core::Code::kDataLoss,
                      "dataset /iirtf/transfer is wrong: its number of coefficients does not fit "
                      "the bands of /sg/zonal; fetch or make the file again");
  }
  database.sh_order = static_cast<std::uint32_t>(bands - 1);
  database.visibility_resolution = static_cast<std::uint32_t>(reader.extents().at("resolution"));
  database.pca_components = static_cast<std::uint32_t>(reader.extents().at("components"));
  database.sg_count = static_cast<std::uint32_t>(reader.extents().at("sg_count"));
  check_values(database);
  check_recolouring(database, contents.recolouring);
  return contents;
}

}  // namespace weft::storage
