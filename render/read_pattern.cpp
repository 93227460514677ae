#include "render/read_pattern.h"

#include <algorithm>
#include <cstdint>
#include <string>
#include <vector>

#include "core/error.h"
#include "render/png.h"

namespace weft::render {
namespace {

[[noreturn]] void refuse(const std::string& what) {
  throw core::Error(core::Code::kInvalidArgument, what);
}

std::uint32_t number_of(char sign) {
  if (sign >= '0' && sign <= '9') {
    return static_cast<std::uint32_t>(sign - '0');
  }
  if (sign >= 'a' && sign <= 'z') {
    return static_cast<std::uint32_t>(sign - 'a') + 10;
  }
  refuse(std::string("a block is written '") + sign +
         "'; write a digit, or a letter from a for 10");
}

void check_number(std::uint32_t number, int fabrics) {
  if (number >= static_cast<std::uint32_t>(fabrics)) {
    refuse("a block shows fabric " + std::to_string(number) + ", but there are only " +
           std::to_string(fabrics) + " in pattern.fabrics, counted from 0");
  }
}

BlockPattern pattern_of_rows(const v1::Pattern& pattern) {
  const auto& rows = pattern.rows().row();
  if (rows.empty() || rows[0].empty()) {
    refuse("the matrix is empty; give a row of at least one block");
  }
  BlockPattern result;
  result.width = static_cast<std::uint32_t>(rows[0].size());
  result.height = static_cast<std::uint32_t>(rows.size());
  if (result.width > kPatternSideLimit || result.height > kPatternSideLimit) {
    refuse("the matrix is too large; give at most " + std::to_string(kPatternSideLimit) +
           " blocks a side");
  }
  result.fabric.clear();
  for (int y = rows.size() - 1; y >= 0; --y) {  // row 0 is the lowest
    if (rows[y].size() != rows[0].size()) {
      refuse("row " + std::to_string(y) + " has " + std::to_string(rows[y].size()) +
             " blocks and row 0 has " + std::to_string(rows[0].size()) +
             "; give rows of equal length");
    }
    for (const char sign : rows[y]) {
      result.fabric.push_back(number_of(sign));
      check_number(result.fabric.back(), pattern.fabrics_size());
    }
  }
  return result;
}

// Grey levels become numbers, the darkest 0.
void number_levels(std::vector<std::uint8_t>& values, int fabrics, const std::string& file) {
  std::vector<std::uint8_t> levels = values;
  std::sort(levels.begin(), levels.end());
  levels.erase(std::unique(levels.begin(), levels.end()), levels.end());
  if (levels.size() != static_cast<std::size_t>(fabrics)) {
    refuse(file + " has " + std::to_string(levels.size()) + " grey levels for " +
           std::to_string(fabrics) +
           " fabrics; paint it with one level for each fabric, or save it with a palette");
  }
  for (std::uint8_t& value : values) {
    value = static_cast<std::uint8_t>(std::lower_bound(levels.begin(), levels.end(), value) -
                                      levels.begin());
  }
}

BlockPattern pattern_of_picture(const v1::Pattern& pattern, const FileSource& files) {
  const std::string& file = pattern.png_file();
  PlainPicture picture = read_plain_png(files(file), file, kPatternSideLimit);
  if (!picture.has_palette) {
    number_levels(picture.values, pattern.fabrics_size(), file);
  }
  BlockPattern result;
  result.width = picture.width;
  result.height = picture.height;
  result.fabric.clear();
  for (std::uint32_t y = picture.height; y-- > 0;) {
    for (std::uint32_t x = 0; x < picture.width; ++x) {
      result.fabric.push_back(picture.values[std::size_t{y} * picture.width + x]);
      check_number(result.fabric.back(), pattern.fabrics_size());
    }
  }
  return result;
}

}  // namespace

BlockPattern pattern_of(const v1::Pattern& pattern, const FileSource& files) {
  return pattern.has_rows() ? pattern_of_rows(pattern) : pattern_of_picture(pattern, files);
}

}  // namespace weft::render
