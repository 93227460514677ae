#include "fabric/presets.h"

#include <algorithm>

#include <google/protobuf/text_format.h>

#include "core/check.h"

namespace weft::fabric {
namespace {

template <class Message>
std::optional<Message> preset(std::string_view kind, std::string_view name) {
  const std::optional<std::string_view> text = embedded_text(kind, name);
  if (!text) {
    return std::nullopt;
  }
  Message message;
  CHECK(google::protobuf::TextFormat::ParseFromString(std::string(*text), &message));
  return message;
}

void scale(v1::Yarn& yarn, double factor) {
  yarn.set_yarn_radius_mm(yarn.yarn_radius_mm() * factor);
  yarn.set_fibre_radius_mm(yarn.fibre_radius_mm() * factor);
  yarn.set_ply_twist_per_cm(yarn.ply_twist_per_cm() / factor);
  yarn.set_fibre_twist_per_cm(yarn.fibre_twist_per_cm() / factor);
  v1::Hairs& hairs = *yarn.mutable_hairs();
  hairs.set_per_mm(hairs.per_mm() / factor);
  hairs.set_length_mm(hairs.length_mm() * factor);
  hairs.set_length_sd_mm(hairs.length_sd_mm() * factor);
  hairs.set_reach_mm(hairs.reach_mm() * factor);
  hairs.set_reach_sd_mm(hairs.reach_sd_mm() * factor);
  v1::Loops& loops = *yarn.mutable_loops();
  loops.set_per_mm(loops.per_mm() / factor);
  loops.set_reach_mm(loops.reach_mm() * factor);
  loops.set_reach_sd_mm(loops.reach_sd_mm() * factor);
}

}  // namespace

std::vector<std::string> embedded_names(std::string_view kind) {
  std::vector<std::string> names;
  for (const EmbeddedText& text : embedded_texts()) {
    if (text.kind == kind) {
      names.emplace_back(text.name);
    }
  }
  return names;
}

std::optional<std::string_view> embedded_text(std::string_view kind, std::string_view name) {
  for (const EmbeddedText& text : embedded_texts()) {
    if (text.kind == kind && text.name == name) {
      return text.text;
    }
  }
  return std::nullopt;
}

std::optional<v1::Yarn> yarn_preset(std::string_view name) {
  return preset<v1::Yarn>("yarn", name);
}

std::optional<v1::Material> material_preset(std::string_view name) {
  return preset<v1::Material>("material", name);
}

void fill_from_preset(v1::Yarn& yarn, const v1::Yarn& preset) {
  v1::Yarn filled = preset;
  if (yarn.yarn_radius_mm() > 0 && preset.yarn_radius_mm() > 0) {
    scale(filled, yarn.yarn_radius_mm() / preset.yarn_radius_mm());
  }
  filled.MergeFrom(yarn);
  filled.clear_preset();
  filled.set_name(yarn.name());
  yarn = filled;
}

void fill_from_preset(v1::Material& material, const v1::Material& preset) {
  v1::Material filled = preset;
  if (material.has_c_r()) {
    filled.clear_c_r();
  }
  if (material.has_c_tt()) {
    filled.clear_c_tt();
  }
  filled.MergeFrom(material);
  filled.clear_preset();
  filled.set_name(material.name());
  material = filled;
}

}  // namespace weft::fabric
