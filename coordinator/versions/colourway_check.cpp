#include "coordinator/versions/colourway_check.h"

#include <map>

#include <google/protobuf/util/json_util.h>

#include "coordinator/versions/carried_over.h"
#include "coordinator/versions/description_changes.h"
#include "coordinator/versions/fibre_materials.h"
#include "core/error.h"
#include "fabric/description.h"

namespace weft::coordinator {

namespace {

using storage::FabricDatabase;

[[noreturn]] void refuse(const ColourwayBase& base, const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument,
                    "this is no colourway of " + base.reference + ": " + what +
                        "; make it with 'weft recolor " + base.reference + "'");
}

void check_origin(const storage::Recolouring& recolouring, const ColourwayBase& base) {
  if (!base.contents.recolouring.carried_over_json.empty()) {
    refuse(base, base.reference + " is a colourway itself, whose light was carried over");
  }
  const CarriedOver carried = parse_carried_over(recolouring.carried_over_json);
  if (carried.base != base.reference || carried.base_digest != base.digest.hex()) {
    refuse(base, recolouring.carried_over_json.empty()
                     ? "it does not say that its light was carried over"
                     : "its light was carried over from '" + carried.base + "', content " +
                           carried.base_digest.substr(0, 12) + ", and that version has content " +
                           base.digest.hex().substr(0, 12));
  }
  if (recolouring.has_orders()) {
    refuse(base, "it has light by orders of scattering, which are of paths that were traced");
  }
}

v1::FabricDescription description_in(const FabricDatabase& database, const ColourwayBase& base) {
  v1::FabricDescription description;
  if (!google::protobuf::util::JsonStringToMessage(database.description_json, &description).ok()) {
    refuse(base, "the description in it is none of this weft");
  }
  return description;
}

// The description without its name and without the colours of its fibres: yarns and fibres name
// what their material is beside its colours.
v1::FabricDescription colourless(v1::FabricDescription description) {
  std::map<std::string, std::string> materials;
  for (v1::Material material : description.materials()) {
    const std::string name = material.name();
    material.clear_name();
    material.clear_c_r();
    material.clear_c_tt();
    materials[name] = "{ " + material.ShortDebugString() + " }";
  }
  const auto what_is = [&](const std::string& name) {
    const auto found = materials.find(name);
    return found == materials.end() ? name : found->second;
  };
  for (v1::Yarn& yarn : *description.mutable_yarns()) {
    yarn.set_material(what_is(yarn.material()));
  }
  if (description.has_explicit_fibres()) {
    for (auto& fibre : *description.mutable_explicit_fibres()->mutable_fibres()) {
      fibre.set_material(what_is(fibre.material()));
    }
  }
  description.clear_materials();
  description.clear_name();
  return description;
}

v1::FabricDescription check_description(const FabricDatabase& colourway, const std::string& fabric,
                                        const ColourwayBase& base) {
  v1::FabricDescription description = description_in(colourway, base);
  if (description.weave().has_wif_file() || description.yarn_curves().has_pyp_file()) {
    refuse(base, "the description in it names a file");
  }
  fabric::check_description(description);
  if (description.name() != fabric) {
    refuse(base, "it is named '" + description.name() + "', and shall be published as " + fabric);
  }
  const auto differences = differences_of(colourless(description_in(base.contents.database, base)),
                                          colourless(description));
  if (!differences.empty()) {
    refuse(base, differences[0].path + " in its description is '" + differences[0].to +
                     "' where it was '" + differences[0].from + "'");
  }
  return description;
}

// Materials are those of the description, and of every strand what it was but for its colours.
void check_materials(const FabricDatabase& colourway, const v1::FabricDescription& description,
                     const ColourwayBase& base) {
  std::map<std::string, shading::FibreMaterial> described;
  for (const v1::Material& material : description.materials()) {
    described[material.name()] = fibre_material(material);
  }
  for (std::size_t m = 0; m < colourway.materials.size(); ++m) {
    const auto found = described.find(colourway.material_names[m]);
    if (found == described.end() || found->second != colourway.materials[m]) {
      refuse(base, "material '" + colourway.material_names[m] + "' is not as its description says");
    }
  }
  const FabricDatabase& old = base.contents.database;
  std::vector<std::uint32_t> strands = colourway.strands;
  for (std::size_t i = 1; i < strands.size() && i < old.strands.size(); i += 3) {
    shading::FibreMaterial was = old.materials[old.strands[i]];
    const shading::FibreMaterial& is = colourway.materials[strands[i]];
    was.c_r = is.c_r;
    was.c_tt = is.c_tt;
    if (was != is) {
      refuse(base, "its fibres scatter light in other directions");
    }
    strands[i] = old.strands[i];
  }
  if (strands != old.strands) {
    refuse(base, "it has other fibres");
  }
}

// Whatever no colour enters is the same to the bit.
void check_the_rest(const FabricDatabase& a, const ColourwayBase& base) {
  const FabricDatabase& b = base.contents.database;
  const bool has_these_fibres = a.size_mm == b.size_mm && a.z_bounds_mm == b.z_bounds_mm &&
                                a.blocks == b.blocks && a.yarn_names == b.yarn_names &&
                                a.threads == b.threads && a.strand_periods == b.strand_periods &&
                                a.strand_radius_mm == b.strand_radius_mm &&
                                a.points_mm == b.points_mm;
  const bool has_these_cells =
      a.mean_free_path_mm == b.mean_free_path_mm && a.sigma_shadow_mm == b.sigma_shadow_mm &&
      a.cells_per_axis == b.cells_per_axis && a.cell_of_segment == b.cell_of_segment &&
      a.cell_coordinates == b.cell_coordinates && a.sh_order == b.sh_order &&
      a.cell_paths == b.cell_paths;
  const bool has_this_visibility =
      a.visibility_resolution == b.visibility_resolution && a.pca_components == b.pca_components &&
      a.ssdf_mean == b.ssdf_mean && a.ssdf_basis == b.ssdf_basis && a.ssdf == b.ssdf &&
      a.sg_count == b.sg_count && a.sg_sharpness == b.sg_sharpness && a.ssg == b.ssg &&
      a.ssg_rotation == b.ssg_rotation && a.open_share == b.open_share &&
      a.ssdf_sign_error == b.ssdf_sign_error;
  const bool has_this_origin = a.stages_json == b.stages_json && a.software == b.software;
  if (!has_these_fibres || !has_these_cells || !has_this_visibility || !has_this_origin) {
    refuse(base, !has_these_fibres      ? "it has other fibres"
                 : !has_these_cells     ? "it has other cells"
                 : !has_this_visibility ? "it has other visibility"
                                        : "it was made from other results");
  }
}

}  // namespace

void check_colourway(const storage::RecolourableDatabase& colourway, const std::string& fabric,
                     const ColourwayBase& base) {
  check_origin(colourway.recolouring, base);
  const v1::FabricDescription description = check_description(colourway.database, fabric, base);
  check_the_rest(colourway.database, base);
  check_materials(colourway.database, description, base);
}

}  // namespace weft::coordinator
