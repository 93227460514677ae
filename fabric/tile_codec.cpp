#include <cstring>
#include <span>

#include "core/error.h"
#include "fabric/tile.h"
#include "proto/arrays.h"

namespace weft::fabric {

namespace {

std::string join_lines(const std::vector<std::string>& names) {
  std::string text;
  for (const std::string& name : names) {
    text += name + "\n";
  }
  return text;
}

std::vector<std::string> split_lines(const std::string& text) {
  std::vector<std::string> names;
  std::size_t start = 0;
  for (std::size_t end = text.find('\n'); end != std::string::npos; end = text.find('\n', start)) {
    names.push_back(text.substr(start, end - start));
    start = end + 1;
  }
  return names;
}

template <class T>
void add(v1::Arrays& arrays, const char* name, std::vector<std::uint64_t> shape,
         const std::vector<T>& data) {
  v1::add_array<T>(arrays, name, std::move(shape), std::span<const T>(data));
}

template <class T>
std::vector<T> take(const v1::Arrays& arrays, const char* name, std::size_t count) {
  std::vector<T> data = v1::array_of<T>(arrays, name);
  if (data.size() != count) {
    throw core::Error(core::Code::kDataLoss, std::string("the tile is damaged: array '") + name +
                                                 "' has the wrong length");
  }
  return data;
}

}  // namespace

std::string encode_tile(const Tile& tile) {
  v1::Arrays arrays;
  add<float>(arrays, "size_mm", {2}, {tile.size_mm.x, tile.size_mm.y});
  add<float>(arrays, "z_bounds_mm", {2}, {tile.z_min_mm, tile.z_max_mm});
  add<std::uint32_t>(arrays, "blocks", {2}, {tile.blocks.x, tile.blocks.y});
  v1::add_text(arrays, "material_names", join_lines(tile.material_names));
  v1::add_text(arrays, "yarn_names", join_lines(tile.yarn_names));

  std::vector<std::uint32_t> threads;
  for (const Thread& thread : tile.threads) {
    threads.insert(threads.end(),
                   {thread.yarn, static_cast<std::uint32_t>(thread.role), thread.index});
  }
  add(arrays, "threads", {tile.threads.size(), 3}, threads);

  std::vector<std::uint32_t> strands;
  std::vector<std::int32_t> periods;
  std::vector<float> radii;
  for (const Strand& strand : tile.strands) {
    strands.insert(strands.end(), {strand.point_count, strand.material, strand.thread});
    periods.insert(periods.end(), {strand.period_x, strand.period_y});
    radii.push_back(strand.radius_mm);
  }
  add(arrays, "strands", {tile.strands.size(), 3}, strands);
  add(arrays, "strand_periods", {tile.strands.size(), 2}, periods);
  add(arrays, "strand_radius_mm", {tile.strands.size()}, radii);

  std::vector<float> points;
  points.reserve(3 * tile.points_mm.size());
  for (const glm::vec3& p : tile.points_mm) {
    points.insert(points.end(), {p.x, p.y, p.z});
  }
  add(arrays, "points_mm", {tile.points_mm.size(), 3}, points);
  return v1::serialize(arrays);
}

Tile decode_tile(std::string_view bytes) {
  const v1::Arrays arrays = v1::parse_arrays(bytes);
  Tile tile;
  const auto size = take<float>(arrays, "size_mm", 2);
  tile.size_mm = {size[0], size[1]};
  const auto z_bounds = take<float>(arrays, "z_bounds_mm", 2);
  tile.z_min_mm = z_bounds[0];
  tile.z_max_mm = z_bounds[1];
  const auto blocks = take<std::uint32_t>(arrays, "blocks", 2);
  tile.blocks = {blocks[0], blocks[1]};
  tile.material_names = split_lines(v1::text_of(arrays, "material_names"));
  tile.yarn_names = split_lines(v1::text_of(arrays, "yarn_names"));

  const auto threads = v1::array_of<std::uint32_t>(arrays, "threads");
  if (threads.size() % 3 != 0) {
    throw core::Error(core::Code::kDataLoss, "the tile is damaged: 'threads' is not n x 3");
  }
  for (std::size_t i = 0; i + 2 < threads.size(); i += 3) {
    if (threads[i] >= tile.yarn_names.size() || threads[i + 1] > 3) {
      throw core::Error(core::Code::kDataLoss, "the tile is damaged: a thread has no yarn");
    }
    tile.threads.push_back({threads[i], static_cast<Role>(threads[i + 1]), threads[i + 2]});
  }

  const auto radii = v1::array_of<float>(arrays, "strand_radius_mm");
  const auto strands = take<std::uint32_t>(arrays, "strands", 3 * radii.size());
  const auto periods = take<std::int32_t>(arrays, "strand_periods", 2 * radii.size());
  std::uint32_t next_point = 0;
  for (std::size_t s = 0; s < radii.size(); ++s) {
    tile.strands.push_back({next_point, strands[3 * s], strands[3 * s + 1], strands[3 * s + 2],
                            radii[s], periods[2 * s], periods[2 * s + 1]});
    next_point += strands[3 * s];
  }

  const auto points = v1::array_of<float>(arrays, "points_mm");
  for (std::size_t i = 0; i + 2 < points.size(); i += 3) {
    tile.points_mm.emplace_back(points[i], points[i + 1], points[i + 2]);
  }
  index_segments(tile);
  return tile;
}

}  // namespace weft::fabric
