#pragma once

#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec3.hpp>

#include "core/digest.h"
#include "shading/fibre_material.h"

namespace weft::storage {

// A fabric database in memory: what /exemplar, /materials, /cells, /iirtf, /visibility, /sg and
// /provenance of the file hold (docs/database_format.md is the contract). Arrays are row-major with
// the axes named beside them; halves are IEEE binary16 bits.
struct FabricDatabase {
  // /exemplar: as fabric::Tile, flattened. Points are unwrapped millimetres.
  glm::vec2 size_mm{0, 0};
  glm::vec2 z_bounds_mm{0, 0};
  glm::uvec2 blocks{1, 1};
  std::vector<std::string> material_names;
  std::vector<std::string> yarn_names;
  std::vector<std::uint32_t> threads;        // [threads, 3]: yarn, role, index
  std::vector<std::uint32_t> strands;        // [strands, 3]: point count, material, thread
  std::vector<std::int32_t> strand_periods;  // [strands, 2]: tiles across, along
  std::vector<float> strand_radius_mm;       // [strands]
  std::vector<float> points_mm;              // [points, 3]

  // /materials
  std::vector<shading::FibreMaterial> materials;  // by material index
  std::vector<float> c_s;  // [materials, 3, 512, (order+1)^2]: SH table of S cos over theta_o

  // /cells
  float mean_free_path_mm = 0;
  float sigma_shadow_mm = 0;  // Gaussian filter of the multiple-scattering shadow
  glm::uvec3 cells_per_axis{1, 1, 1};
  std::vector<std::uint32_t> cell_of_segment;   // [segments]
  std::vector<std::uint32_t> cell_coordinates;  // [cells, 3]

  // /iirtf: transfer matrices, c_T = A c_light
  std::uint32_t sh_order = 0;
  std::vector<std::uint64_t> cell_paths;  // [cells]
  std::vector<float> transfer;            // [cells, 3, (order+1)^2 (j1), (order+1)^2 (j0)]
  std::vector<float> transfer_se;         // standard error, same shape

  // /visibility
  std::uint32_t visibility_resolution = 0;  // rows theta (polar, from +z), columns phi
  std::uint32_t pca_components = 0;
  std::vector<float> ssdf_mean;     // [resolution, resolution] radians
  std::vector<float> ssdf_basis;    // [components, resolution, resolution]
  std::vector<std::uint16_t> ssdf;  // half [segments, components]
  std::uint32_t sg_count = 0;
  float sg_sharpness = 0;
  std::vector<std::uint16_t> ssg;           // half [segments, sg_count], steradian
  std::vector<std::uint16_t> ssg_rotation;  // [segments]: rotation about z, 2 pi / 65536
  std::vector<std::uint16_t> open_share;    // half [segments]: visible share of the sphere
  double ssdf_sign_error = 0;               // share of held-out pixels with the wrong sign

  // /provenance
  std::string description_json;  // canonical description
  std::string stages_json;       // settings, seeds and result digests of every stage
  std::string software;          // name and schema, never a date or a host
};

// Writes `database` as schema 1. The bytes depend on nothing but the contents. Written beside,
// verified and renamed: `path` holds the old file or the whole new one. Returns the content digest,
// which the file's user block holds. Standard errors are stored as halves; transfer matrices too,
// where rounding adds less than a tenth of their standard error, and as floats elsewhere. Throws
// core::Error(kDataLoss) naming the dataset when the contents contradict each other.
core::Digest write_database(const FabricDatabase& database, const std::filesystem::path& path);

// Rounds the light of `database` as write_database does, so that what is read from its file is what
// it is, and writing that again gives the same bytes.
void round_as_written(FabricDatabase& database);

// Reads schema 1 with limits, after checking the digest: throws core::Error(kDataLoss) naming the
// dataset on any damage, on links, external storage, virtual datasets, foreign filters, shapes
// larger than the file can hold, counts that contradict each other, indices out of range and
// numbers that are not finite; kNotFound when there is no file; kFailedPrecondition when its schema
// is newer.
[[nodiscard]] FabricDatabase read_database(const std::filesystem::path& path);

// The digest in the user block, after checking it against the file and reading all of it. Throws as
// read_database.
core::Digest verify_database(const std::filesystem::path& path);

// The same, after checking it against the file's bytes alone: nothing is parsed. Throws as
// read_database does of damaged bytes.
[[nodiscard]] core::Digest checked_digest(const std::filesystem::path& path);

// The digest in the user block, unchecked.
[[nodiscard]] core::Digest content_digest(const std::filesystem::path& path);

}  // namespace weft::storage
