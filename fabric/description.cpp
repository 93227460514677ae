#include "fabric/description.h"

#include <google/protobuf/io/tokenizer.h>
#include <google/protobuf/text_format.h>

#include "core/error.h"
#include "core/file.h"
#include "fabric/description_defaults.h"

namespace weft::fabric {
namespace {

class Collector : public google::protobuf::io::ErrorCollector {
 public:
  explicit Collector(std::string name) : name_(std::move(name)) {}
  void AddError(int line, google::protobuf::io::ColumnNumber column,
                const std::string& message) override {
    text_ += (text_.empty() ? "" : "\n") + name_ + ":" + std::to_string(line + 1) + ":" +
             std::to_string(column + 1) + ": " + message;
  }
  [[nodiscard]] const std::string& text() const { return text_; }

 private:
  std::string name_;
  std::string text_;
};

}  // namespace

v1::FabricDescription load_description(const std::filesystem::path& path, v1::Quality quality) {
  return parse_description(core::read_file(path, std::uint64_t{64} << 20), path.string(),
                           path.parent_path(), quality);
}

v1::FabricDescription parse_description(std::string_view text, const std::string& name,
                                        const std::filesystem::path& /*folder*/,
                                        v1::Quality quality) {
  v1::FabricDescription description;
  Collector collector(name);
  google::protobuf::TextFormat::Parser parser;
  parser.RecordErrorsTo(&collector);
  if (!parser.ParseFromString(std::string(text), &description)) {
    throw core::Error(core::Code::kInvalidArgument, collector.text());
  }
  if (quality != v1::QUALITY_UNSPECIFIED) {
    description.mutable_precompute()->set_quality(quality);
  }
  expand_defaults(description);
  apply_quality(description);
  check_description(description);
  return description;
}

void check_description(const v1::FabricDescription& description) {
  if (description.structure_case() == v1::FabricDescription::STRUCTURE_NOT_SET) {
    throw core::Error(core::Code::kInvalidArgument,
                      "the description has no structure; give a weave, yarn_curves or "
                      "explicit_fibres");
  }
}

v1::FabricDescription geometry_part(const v1::FabricDescription& description) {
  v1::FabricDescription part = description;
  part.clear_name();
  part.clear_comment();
  part.clear_precompute();
  for (v1::Material& material : *part.mutable_materials()) {
    const std::string name = material.name();
    material.Clear();
    material.set_name(name);
  }
  return part;
}

}  // namespace weft::fabric
