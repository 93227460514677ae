#include "fabric/description.h"

#include <algorithm>
#include <map>
#include <optional>
#include <set>

#include "core/error.h"
#include "core/file.h"
#include "fabric/build.h"
#include "fabric/description_check.h"
#include "fabric/description_defaults.h"
#include "fabric/draft.h"
#include "fabric/presets.h"
#include "fabric/wif.h"
#include "fabric/wif_file.h"
#include "proto/document.h"

namespace weft::fabric {
namespace {

constexpr std::uint64_t kMaxDescriptionBytes = std::uint64_t{64} << 20;
constexpr std::uint64_t kMaxCurvesBytes = std::uint64_t{64} << 20;

// Reads a file that the description names; on failure lists the mistake and returns nothing.
std::string inlined(const std::string& file, const std::filesystem::path& folder,
                    std::uint64_t limit_bytes, const std::string& path, core::Mistakes& mistakes) {
  try {
    return core::read_file(folder / file, limit_bytes);
  } catch (const core::Error& error) {
    mistakes.push_back({path, error.what()});
    return "";
  }
}

void inline_files(v1::FabricDescription& description, const std::filesystem::path& folder,
                  core::Mistakes& mistakes) {
  if (description.weave().has_wif_file()) {
    const std::string file = description.weave().wif_file();
    std::string text = inlined(file, folder, kMaxWifBytes, "weave.wif_file", mistakes);
    if (!text.empty()) {
      description.mutable_weave()->set_wif_text(std::move(text));
    }
  }
  if (description.yarn_curves().has_pyp_file()) {
    const std::string file = description.yarn_curves().pyp_file();
    std::string text = inlined(file, folder, kMaxCurvesBytes, "yarn_curves.pyp_file", mistakes);
    if (!text.empty()) {
      description.mutable_yarn_curves()->set_pyp_text(std::move(text));
    }
  }
}

// Takes the sett that is not set from the draft, and says where the draft is broken.
void sett_from_draft(v1::Weave& weave, const std::string& wif_name, const std::string& path,
                     core::Mistakes& mistakes) {
  if (!weave.has_wif_text()) {
    return;
  }
  try {
    const WifDraft draft = read_wif(weave.wif_text(), wif_name);
    if (weave.ends_per_cm() == 0 && draft.warp.spacing_mm > 0) {
      weave.set_ends_per_cm(10 / draft.warp.spacing_mm);
    }
    if (weave.picks_per_cm() == 0 && draft.weft.spacing_mm > 0) {
      weave.set_picks_per_cm(10 / draft.weft.spacing_mm);
    }
  } catch (const core::Error& error) {
    mistakes.push_back({path, error.what()});
  }
}

// The yarns that the structure names, in the order it names them.
std::vector<std::string> yarns_named(const v1::FabricDescription& description) {
  std::vector<std::string> names;
  const auto add = [&](const std::string& name) {
    if (!name.empty() && std::find(names.begin(), names.end(), name) == names.end()) {
      names.push_back(name);
    }
  };
  add(description.weave().warp_yarn());
  add(description.weave().weft_yarn());
  for (const v1::ColourYarn& entry : description.weave().colour_yarns()) {
    add(entry.warp_yarn());
    add(entry.weft_yarn());
  }
  add(description.yarn_curves().yarn());
  return names;
}

template <class Messages>
bool has_name(const Messages& messages, const std::string& name) {
  return std::any_of(messages.begin(), messages.end(),
                     [&](const auto& message) { return message.name() == name; });
}

void fill_yarn_presets(v1::FabricDescription& description, core::Mistakes& mistakes) {
  for (int y = 0; y < description.yarns_size(); ++y) {
    v1::Yarn& yarn = *description.mutable_yarns(y);
    if (yarn.preset().empty()) {
      continue;
    }
    if (const std::optional<v1::Yarn> preset = yarn_preset(yarn.preset())) {
      fill_from_preset(yarn, *preset);
    } else {
      mistakes.push_back({"yarns[" + std::to_string(y) + "].preset",
                          "there is no yarn preset " + core::in_quotes(yarn.preset()) +
                              core::suggestion(yarn.preset(), embedded_names("yarn"))});
    }
  }
  for (const std::string& name : yarns_named(description)) {
    if (!has_name(description.yarns(), name)) {
      if (std::optional<v1::Yarn> preset = yarn_preset(name)) {
        *description.add_yarns() = *std::move(preset);
      }
    }
  }
}

void fill_material_presets(v1::FabricDescription& description, core::Mistakes& mistakes) {
  for (int m = 0; m < description.materials_size(); ++m) {
    v1::Material& material = *description.mutable_materials(m);
    if (material.preset().empty()) {
      continue;
    }
    if (const std::optional<v1::Material> preset = material_preset(material.preset())) {
      fill_from_preset(material, *preset);
    } else {
      mistakes.push_back({"materials[" + std::to_string(m) + "].preset",
                          "there is no material preset " + core::in_quotes(material.preset()) +
                              core::suggestion(material.preset(), embedded_names("material"))});
    }
  }
  const auto add = [&](const std::string& name) {
    if (!has_name(description.materials(), name)) {
      if (std::optional<v1::Material> preset = material_preset(name)) {
        *description.add_materials() = *std::move(preset);
      }
    }
  };
  for (const v1::Yarn& yarn : description.yarns()) {
    add(yarn.material());
  }
  for (const v1::ExplicitFibres::Fibre& fibre : description.explicit_fibres().fibres()) {
    add(fibre.material());
  }
}

// Drops the yarns and materials that nothing uses: they are no part of the cloth.
void drop_unused(v1::FabricDescription& description) {
  std::set<std::string> used;
  if (description.has_weave()) {
    const Draft draft = draft_of(description.weave());
    used.insert(draft.end_yarns.begin(), draft.end_yarns.end());
    used.insert(draft.pick_yarns.begin(), draft.pick_yarns.end());
  } else if (description.has_yarn_curves()) {
    used.insert(description.yarn_curves().yarn());
  }
  const auto keep = [](auto& messages, const std::set<std::string>& names) {
    messages.erase(std::remove_if(messages.begin(), messages.end(),
                                  [&](const auto& m) { return !names.contains(m.name()); }),
                   messages.end());
  };
  keep(*description.mutable_yarns(), used);
  std::set<std::string> materials;
  for (const v1::Yarn& yarn : description.yarns()) {
    materials.insert(yarn.material());
  }
  for (const v1::ExplicitFibres::Fibre& fibre : description.explicit_fibres().fibres()) {
    materials.insert(fibre.material());
  }
  keep(*description.mutable_materials(), materials);
}

std::string structure_path(const v1::FabricDescription& description) {
  return description.has_weave()         ? "weave"
         : description.has_yarn_curves() ? "yarn_curves"
                                         : "explicit_fibres";
}

// The draft and the curves as the geometry reads them: whatever writes them the same way gives the
// same bytes. A draft becomes the matrix of its minimal repeat.
void reduce_weave(v1::Weave& weave, const v1::FabricDescription& description) {
  const Draft draft = draft_of(weave);
  std::map<std::string, std::uint32_t> colour_of;
  for (int y = 0; y < description.yarns_size(); ++y) {
    colour_of[description.yarns(y).name()] = static_cast<std::uint32_t>(y) + 1;
  }
  v1::Weave reduced;
  reduced.set_ends_per_cm(weave.ends_per_cm());
  reduced.set_picks_per_cm(weave.picks_per_cm());
  v1::Matrix& matrix = *reduced.mutable_matrix();
  for (std::uint32_t pick = 0; pick < draft.picks; ++pick) {
    std::string& row = *matrix.add_rows();
    for (std::uint32_t end = 0; end < draft.ends; ++end) {
      row += draft.warp_up(pick, end) ? 'X' : '.';
    }
    matrix.add_pick_colours(colour_of[draft.pick_yarns[pick]]);
  }
  for (const std::string& yarn : draft.end_yarns) {
    matrix.add_end_colours(colour_of[yarn]);
  }
  for (int y = 0; y < description.yarns_size(); ++y) {
    v1::ColourYarn& entry = *reduced.add_colour_yarns();
    entry.set_colour(static_cast<std::uint32_t>(y) + 1);
    entry.set_warp_yarn(description.yarns(y).name());
    entry.set_weft_yarn(description.yarns(y).name());
  }
  weave = std::move(reduced);
}

}  // namespace

v1::FabricDescription load_description(const std::filesystem::path& path, v1::Quality quality) {
  return parse_description(core::read_file(path, kMaxDescriptionBytes), path.string(),
                           path.parent_path(), quality);
}

v1::FabricDescription parse_description(std::string_view text, const std::string& name,
                                        const std::filesystem::path& folder, v1::Quality quality) {
  v1::FabricDescription description;
  const std::unique_ptr<v1::Document> written = v1::read_document(text, name, description);
  const auto refuse_if = [&](const core::Mistakes& mistakes, core::Code code) {
    if (const std::string listing = written->listing(mistakes); !listing.empty()) {
      throw core::Error(code, listing);
    }
  };
  if (written->unreadable()) {
    refuse_if({}, core::Code::kInvalidArgument);
  }
  core::Mistakes mistakes;
  const bool has_file = description.weave().has_wif_file();
  const std::string wif_name = has_file ? description.weave().wif_file() : "the draft";
  inline_files(description, folder, mistakes);
  if (description.has_weave()) {
    sett_from_draft(*description.mutable_weave(), wif_name,
                    has_file ? "weave.wif_file" : "weave.wif_text", mistakes);
  }
  fill_yarn_presets(description, mistakes);
  fill_material_presets(description, mistakes);
  if (quality != v1::QUALITY_UNSPECIFIED) {
    description.mutable_precompute()->set_quality(quality);
  }
  expand_defaults(description);
  const bool draft_is_right = mistakes.empty();
  for (core::Mistake& mistake : check_fields(description)) {
    // A draft that could not be read is listed once, and so is a preset that there is none of.
    const bool follows = !draft_is_right && mistake.path == "weave";
    if (!follows) {
      mistakes.push_back(std::move(mistake));
    }
  }
  refuse_if(mistakes, core::Code::kInvalidArgument);
  drop_unused(description);
  try {
    apply_quality(description);
    check_size(description);
  } catch (const core::Error& error) {
    refuse_if({{structure_path(description), error.what()}}, error.code());
  }
  return description;
}

void check_description(const v1::FabricDescription& description) {
  v1::FabricDescription canonical = description;
  expand_defaults(canonical);
  std::string listing;
  for (const core::Mistake& mistake : check_fields(description)) {
    listing.append(listing.empty() ? "" : "\n").append(mistake.path);
    listing.append(mistake.path.empty() ? "" : ": ").append(mistake.message);
  }
  if (listing.empty() && canonical.SerializeAsString() != description.SerializeAsString()) {
    listing = "the description's defaults are not expanded; load it from its file again";
  }
  if (!listing.empty()) {
    throw core::Error(core::Code::kInvalidArgument, listing);
  }
  check_size(description);
}

v1::FabricDescription geometry_part(const v1::FabricDescription& description) {
  v1::FabricDescription part = description;
  part.clear_name();
  part.clear_comment();
  part.clear_precompute();
  if (part.has_weave()) {
    reduce_weave(*part.mutable_weave(), description);
  }
  for (v1::Material& material : *part.mutable_materials()) {
    const std::string name = material.name();
    material.Clear();
    material.set_name(name);
  }
  return part;
}

}  // namespace weft::fabric
