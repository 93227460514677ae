#include "storage/database_schema.h"

#include <algorithm>
#include <cctype>
#include <vector>

#include "core/check.h"
#include "core/error.h"

namespace weft::storage {

namespace {

using h5::Element;

const GroupSpec kGroups[] = {
    {"/exemplar", "the fibres of one periodic tile of cloth, in millimetres"},
    {"/materials", "scattering of the fibres, by material"},
    {"/cells", "the grid of cells that share a transfer matrix"},
    {"/iirtf", "indirect light: transfer matrices by cell (Khungurn et al. 2017, section 4.2)"},
    {"/visibility", "which directions see the sky, by segment"},
    {"/visibility/ssdf",
     "spherical signed distance to the edge of visibility, by principal "
     "components; for sharp lights"},
    {"/visibility/ssg", "visibility as a sum of spherical Gaussians; for soft lights"},
    {"/sg", "spherical Gaussian lights in spherical harmonics"},
    {"/provenance", "what the file was made from"},
};

const DatasetSpec kDatasets[] = {
    {"/exemplar/size_mm",
     Element::kF32,
     "2",
     false,
     {"mm", "across (x), along (y)", "size of the tile; it repeats endlessly in x and y"}},
    {"/exemplar/z_bounds_mm",
     Element::kF32,
     "2",
     false,
     {"mm", "lowest, highest", "bounds of all fibres in z, radii included; +z faces the viewer"}},
    {"/exemplar/blocks",
     Element::kU32,
     "2",
     false,
     {"1", "across (x), along (y)",
      "equal blocks of whole ends and picks that the tile divides "
      "into"}},
    {"/exemplar/material_names", Element::kText, "materials", true, {"", "material", "names"}},
    {"/exemplar/yarn_names", Element::kText, "yarns", true, {"", "yarn", "names"}},
    {"/exemplar/threads",
     Element::kU32,
     "threads, 3",
     true,
     {"1", "thread; yarn, role, index",
      "one row per end, pick or curve; role 0 warp, 1 weft, 2 curve, 3 explicit fibre"}},
    {"/exemplar/strands",
     Element::kU32,
     "strands, 3",
     true,
     {"1", "strand; points, material, thread",
      "one row per connected fibre; its points follow those of the strand before it"}},
    {"/exemplar/strand_periods",
     Element::kI32,
     "strands, 2",
     true,
     {"tiles", "strand; across (x), along (y)",
      "the last point is the first one moved by this many tiles; 0, 0: open ends"}},
    {"/exemplar/strand_radius_mm",
     Element::kF32,
     "strands",
     true,
     {"mm", "strand", "radius of the fibre"}},
    {"/exemplar/points_mm",
     Element::kF32,
     "points, 3",
     true,
     {"mm", "point; x, y, z",
      "fibre axes, not wrapped into the tile; a strand of n points has n - 1 segments, numbered "
      "along the strands"}},
    {"/materials/c_r",
     Element::kF32,
     "materials, 3",
     false,
     {"1", "material; red, green, blue", "reflection at normal incidence, linear"}},
    {"/materials/c_tt",
     Element::kF32,
     "materials, 3",
     false,
     {"1", "material; red, green, blue", "transmission, linear"}},
    {"/materials/beta_r",
     Element::kF32,
     "materials",
     false,
     {"rad", "material", "longitudinal width of reflection"}},
    {"/materials/beta_tt",
     Element::kF32,
     "materials",
     false,
     {"rad", "material", "longitudinal width of transmission"}},
    {"/materials/gamma_tt",
     Element::kF32,
     "materials",
     false,
     {"rad", "material", "azimuthal width of transmission"}},
    {"/materials/theta_o",
     Element::kF32,
     "512",
     true,
     {"rad", "theta_o", "longitudinal angle to the viewer, of c_s"}},
    {"/materials/c_s",
     Element::kF32,
     "materials, 3, 512, coefficients",
     true,
     {"1", "material; red, green, blue; theta_o; spherical harmonic j = l (l + 1) + m",
      "integral of Y_j(omega) S(omega, omega_o) cos(theta) over omega, omega_o-space"}},
    {"/cells/mean_free_path_mm",
     Element::kF32,
     "1",
     false,
     {"mm", "one number", "mean free path between fibre hits, inside the cloth"}},
    {"/cells/sigma_shadow_mm",
     Element::kF32,
     "1",
     false,
     {"mm", "one number", "standard deviation of the filter of shadows in multiple scattering"}},
    {"/cells/cells_per_axis",
     Element::kU32,
     "3",
     false,
     {"1", "x, y, z", "grid over size_mm and z_bounds_mm; empty places have no cell"}},
    {"/cells/cell_of_segment",
     Element::kU32,
     "segments",
     true,
     {"1", "segment", "index of the cell that holds the segment's midpoint"}},
    {"/cells/coordinates",
     Element::kU32,
     "cells, 3",
     true,
     {"1", "cell; x, y, z", "place of each cell in the grid"}},
    {"/iirtf/paths", Element::kU64, "cells", true, {"1", "cell", "paths behind each matrix"}},
    {"/iirtf/transfer",
     Element::kF16,
     "cells, 3, coefficients, coefficients",
     true,
     {"1", "cell; red, green, blue; incoming j1; light j0",
      "transfer matrix: coefficients of incoming radiance = matrix times coefficients of the "
      "light"}},
    {"/iirtf/standard_error",
     Element::kF16,
     "cells, 3, coefficients, coefficients",
     true,
     {"1", "cell; red, green, blue; incoming j1; light j0",
      "standard error of each coefficient of transfer"}},
    {"/visibility/theta",
     Element::kF32,
     "resolution",
     true,
     {"rad", "theta", "polar angle from +z of the centre of each row of directions"}},
    {"/visibility/phi",
     Element::kF32,
     "resolution",
     true,
     {"rad", "phi", "azimuth from +x to +y of the centre of each column of directions"}},
    {"/visibility/open_share",
     Element::kF16,
     "segments",
     true,
     {"1", "segment", "share of the sphere of directions that is visible"}},
    {"/visibility/ssdf/mean",
     Element::kF32,
     "resolution, resolution",
     true,
     {"rad", "theta; phi", "mean signed distance; positive where visible"}},
    {"/visibility/ssdf/basis",
     Element::kF32,
     "components, resolution, resolution",
     true,
     {"rad", "component; theta; phi", "principal components"}},
    {"/visibility/ssdf/coefficients",
     Element::kF16,
     "segments, components",
     true,
     {"1", "segment; component", "distance = mean + sum of coefficient times component"}},
    {"/visibility/ssdf/sign_error",
     Element::kF64,
     "1",
     false,
     {"1", "one number", "share of held-out directions whose reconstructed sign is wrong"}},
    {"/visibility/ssg/sharpness",
     Element::kF32,
     "1",
     false,
     {"1", "one number", "lambda of every Gaussian, exp(lambda (omega . axis - 1))"}},
    {"/visibility/ssg/axes",
     Element::kF32,
     "sg_count, 3",
     true,
     {"1", "Gaussian; x, y, z", "axes before the segment's rotation about +z"}},
    {"/visibility/ssg/weights",
     Element::kF16,
     "segments, sg_count",
     true,
     {"sr", "segment; Gaussian", "visible solid angle nearest to each axis"}},
    {"/visibility/ssg/rotation",
     Element::kU16,
     "segments",
     true,
     {"2 pi / 65536 rad", "segment", "rotation of the axes about +z"}},
    {"/sg/sharpness",
     Element::kF32,
     "128",
     true,
     {"1", "sharpness", "lambda of a light exp(lambda (omega . axis - 1)) / M(lambda)"}},
    {"/sg/zonal",
     Element::kF32,
     "128, bands",
     true,
     {"1", "sharpness; band l",
      "coefficient (l, 0) of the light about +z; about another axis xi, coefficient (l, m) is "
      "zonal[l] sqrt(4 pi / (2 l + 1)) Y_lm(xi)"}},
    {"/provenance/description",
     Element::kText,
     "1",
     true,
     {"", "one text", "the fabric's description, every default expanded (JSON)"}},
    {"/provenance/stages",
     Element::kText,
     "1",
     true,
     {"", "one text", "settings, seeds and digests of the results of every stage (JSON)"}},
    {"/provenance/software", Element::kText, "1", true, {"", "one text", "what wrote the file"}},
    {"/iirtf/order_light",
     Element::kF16,
     "cells, order_groups, 11, 3",
     true,
     {"1", "cell; group of materials; order of scattering; red, green, blue",
      "light that arrives after 1, 2, 3, 4, 5, 7, 10, 15, 23, 35, 55 scatterings or more"},
     true},
    {"/iirtf/order_counts",
     Element::kF16,
     "cells, order_groups, 11, 3, order_counts",
     true,
     {"1",
      "cell; group of materials; order of scattering; red, green, blue; scatterings, then for each "
      "material by c_r and by (1 - c_r) c_tt",
      "mean counts of that light"},
     true},
    {"/iirtf/order_shapes",
     Element::kF16,
     "cells, 4, low_coefficients, low_coefficients",
     true,
     {"1", "cell; 2, 3 to 4, 5 to 9, 10 scatterings or more; incoming j1; light j0",
      "parts of transfer by order, mean of the channels"},
     true},
    {"/provenance/carried_over",
     Element::kText,
     "1",
     true,
     {"", "one text",
      "from what the light was carried over to these colours, and its error (JSON)"},
     true},
};

std::vector<std::string> names_of(const DatasetSpec& spec) {
  std::vector<std::string> names;
  std::string_view rest = spec.extents;
  for (std::size_t comma = 0; comma != std::string_view::npos;) {
    comma = rest.find(", ");
    names.emplace_back(rest.substr(0, comma));
    rest.remove_prefix(comma == std::string_view::npos ? rest.size() : comma + 2);
  }
  return names;
}

bool is_number(const std::string& name) {
  return std::isdigit(static_cast<unsigned char>(name[0])) != 0;
}

}  // namespace

std::span<const DatasetSpec> dataset_specs() { return kDatasets; }
std::span<const GroupSpec> group_specs() { return kGroups; }

const DatasetSpec& dataset_spec(std::string_view path) {
  const auto* const found =
      std::find_if(std::begin(kDatasets), std::end(kDatasets),
                   [path](const DatasetSpec& spec) { return path == spec.path; });
  CHECK(found != std::end(kDatasets));
  return *found;
}

std::uint64_t Extents::at(const std::string& name) const {
  const auto found = counts_.find(name);
  CHECK(found != counts_.end());
  return found->second;
}

h5::Shape Extents::shape_of(const DatasetSpec& spec) const {
  h5::Shape shape;
  for (const std::string& name : names_of(spec)) {
    shape.push_back(is_number(name) ? std::stoull(name) : at(name));
  }
  return shape;
}

void Extents::bind(const DatasetSpec& spec, const h5::Shape& shape) {
  const std::vector<std::string> names = names_of(spec);
  const auto refuse = [&] {
    throw core::Error(core::Code::kDataLoss, std::string("dataset ") + spec.path + " has shape " +
                                                 h5::to_string(shape) + " where [" + spec.extents +
                                                 "] was expected; fetch or make the file again");
  };
  if (shape.size() != names.size()) {
    refuse();
  }
  for (std::size_t axis = 0; axis < shape.size(); ++axis) {
    const std::uint64_t expected = is_number(names[axis])
                                       ? std::stoull(names[axis])
                                       : counts_.emplace(names[axis], shape[axis]).first->second;
    if (shape[axis] != expected || shape[axis] == 0) {
      refuse();
    }
  }
}

}  // namespace weft::storage
