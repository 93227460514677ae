#include "fabric/wif_threads.h"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <vector>

namespace weft::fabric {
namespace {

constexpr std::uint32_t kMaxComponent = 1U << 24;
constexpr std::uint32_t kMaxColour = 1U << 20;

// What a thread shows whose colour the file does not say: a warp of dark blue, a weft of cream, and
// greys for further numbers.
std::array<double, 3> stand_in_colour(std::uint32_t colour) {
  constexpr std::array<double, 3> kWarp{0.16, 0.24, 0.47};
  constexpr std::array<double, 3> kWeft{0.93, 0.88, 0.76};
  const double grey = 0.3 + 0.1 * static_cast<double>(colour % 5);
  return colour == 1 ? kWarp : colour == 2 ? kWeft : std::array<double, 3>{grey, grey, grey};
}

struct ColourRange {
  std::uint32_t low = 0;
  std::uint32_t high = 255;
};

ColourRange read_range(WifFile& file) {
  const WifSection* palette = file.find("COLOR PALETTE");
  if (palette == nullptr) {
    file.note("[COLOR PALETTE] is missing; colours are taken to range from 0 to 255");
    return {};
  }
  if (const WifEntry* form = palette->find("FORM");
      form != nullptr && form->value != "RGB" && form->value != "rgb" && form->value != "Rgb") {
    file.note("[COLOR PALETTE] Form=" + form->value + " is not known; colours are read as RGB");
  }
  const WifEntry* range = palette->find("RANGE");
  if (range == nullptr || range->value.empty()) {
    file.note("[COLOR PALETTE] has no Range; colours are taken to range from 0 to 255");
    return {};
  }
  const std::vector<std::uint32_t> bounds = file.whole_numbers(*palette, *range, kMaxComponent);
  if (bounds.size() != 2 || bounds[0] >= bounds[1]) {
    file.fail(*palette, range->line,
              "Range is \"" + range->value + "\"; write the least and the greatest, such as 0,255");
  }
  return {bounds[0], bounds[1]};
}

std::array<double, 3> scaled(const std::vector<std::uint32_t>& rgb, std::size_t from,
                             const ColourRange& range) {
  std::array<double, 3> colour{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double value = static_cast<double>(rgb[from + c]) - range.low;
    colour[c] = std::clamp(value / (static_cast<double>(range.high) - range.low), 0.0, 1.0);
  }
  return colour;
}

// The range as it is stated, or the next usual one when a component exceeds it.
ColourRange repaired_range(WifFile& file, const ColourRange& stated, std::uint32_t greatest) {
  if (greatest <= stated.high) {
    return stated;
  }
  ColourRange range = stated;
  for (const std::uint32_t usual : {255U, 999U, 65535U, kMaxComponent}) {
    if (greatest <= usual) {
      range.high = usual;
      break;
    }
  }
  file.note("[COLOR TABLE] has a component of " + std::to_string(greatest) +
            " in a range that ends at " + std::to_string(stated.high) +
            "; the range is taken to end at " + std::to_string(range.high));
  return range;
}

std::optional<double> mm_per_unit(WifFile& file, const std::string& side, const WifSection& section,
                                  double spacing) {
  constexpr double kInch = 25.4;
  const WifEntry* units = section.find("UNITS");
  if (units == nullptr || units->value.empty()) {
    const bool decipoints = spacing >= 5;
    file.note(bracketed(side) + " has no Units; its lengths are taken for " +
              (decipoints ? "decipoints" : "centimeters"));
    return decipoints ? kInch / 720 : 10;
  }
  std::string name;
  for (const char c : units->value) {
    name += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  for (const char* unit : {"centimeters", "centimetres", "centimeter", "centimetre", "cm"}) {
    if (name == unit) {
      return 10;
    }
  }
  for (const char* unit : {"inches", "inch", "in"}) {
    if (name == unit) {
      return kInch;
    }
  }
  for (const char* unit : {"millimeters", "millimetres", "mm"}) {
    if (name == unit) {
      return 1;
    }
  }
  if (name == "decipoints" || name == "decipoint") {
    return kInch / 720;
  }
  file.note(bracketed(side) + " Units=" + units->value +
            " is not known (decipoints, inches, centimeters); its lengths are left out");
  return std::nullopt;
}

// Mean of a length over all threads, in the file's units: the side's own value, and the section of
// deviating threads. 0 when the file gives none.
double mean_length(WifFile& file, const WifSection& side, const char* what, WifThreads& threads) {
  double common = 0;
  std::string key = what;
  if (const WifEntry* entry = side.find(key); entry != nullptr && !entry->value.empty()) {
    common = file.number(side, *entry);
    if (common < 0) {
      file.fail(side, entry->line, key + " is negative; a length is needed");
    }
  }
  const WifSection* section = file.find(side.name + " " + key);
  if (section == nullptr) {
    return common;
  }
  std::vector<double> lengths(threads.count, common);
  const ThreadNumbering numbering(file, *section, threads.count);
  for (const WifEntry& entry : section->entries) {
    const std::uint32_t thread = numbering.index(file.key_number(*section, entry));
    if (thread >= threads.count || entry.value.empty()) {
      continue;
    }
    lengths[thread] = file.number(*section, entry);
    if (lengths[thread] < 0) {
      file.fail(*section, entry.line, "thread " + entry.key + " has a negative length");
    }
  }
  double sum = 0;
  for (const double length : lengths) {
    sum += length;
    threads.even = threads.even && length == lengths.front();
  }
  return sum / threads.count;
}

void read_lengths(WifFile& file, const WifSection& side, WifThreads& threads) {
  const double spacing = mean_length(file, side, "SPACING", threads);
  const double thickness = mean_length(file, side, "THICKNESS", threads);
  if (spacing > 0 || thickness > 0) {
    if (const std::optional<double> unit = mm_per_unit(file, side.name, side, spacing)) {
      threads.spacing_mm = spacing * *unit;
      threads.thickness_mm = thickness * *unit;
    }
  }
  if (!threads.even) {
    file.note(bracketed(side.name) + " threads differ in spacing or thickness; their mean is used");
  }
}

// One colour of a thread: a number of the table, a number and its own RGB, or RGB alone.
std::uint32_t colour_of(WifFile& file, const WifSection& section, const WifEntry& entry,
                        const ColourRange& range, WifDraft& draft) {
  const std::vector<std::uint32_t> numbers = file.whole_numbers(section, entry, kMaxComponent);
  if (numbers.size() == 1) {
    return std::min(numbers[0], kMaxColour);
  }
  if (numbers.size() == 4) {
    draft.colours.try_emplace(numbers[0], scaled(numbers, 1, range));
    return numbers[0];
  }
  if (numbers.size() != 3) {
    file.fail(section, entry.line,
              entry.key + "=" + entry.value +
                  " is no colour; write its number in the colour table, or red,green,blue");
  }
  const std::array<double, 3> rgb = scaled(numbers, 0, range);
  for (const auto& [number, colour] : draft.colours) {
    if (colour == rgb) {
      return number;
    }
  }
  const std::uint32_t fresh = draft.colours.empty() ? 1 : draft.colours.rbegin()->first + 1;
  draft.colours[fresh] = rgb;
  return fresh;
}

}  // namespace

ThreadNumbering::ThreadNumbering(WifFile& file, const WifSection& section, std::uint32_t count)
    : count_(count) {
  bool zero = false;
  std::uint32_t greatest = 0;
  std::uint32_t outside = 0;
  for (const WifEntry& entry : section.entries) {
    const std::uint32_t key = file.key_number(section, entry);
    zero = zero || key == 0;
    greatest = std::max(greatest, key);
    outside += key > count ? 1U : 0U;
  }
  if (zero && greatest < count) {
    first_ = 0;
    file.note(bracketed(section.name) + " counts from 0; it was read so");
  } else if (zero) {
    file.note(bracketed(section.name) + " has a number 0; it is ignored");
  }
  if (outside > 0) {
    file.note(bracketed(section.name) + " has " + std::to_string(outside) + " entries beyond the " +
              std::to_string(count) + " there are; they are ignored");
  }
}

std::uint32_t ThreadNumbering::index(std::uint32_t key) const {
  return key < first_ ? count_ : key - first_;
}

void read_colour_table(WifFile& file, WifDraft& draft) {
  const WifSection* table = file.find("COLOR TABLE");
  if (table == nullptr || table->entries.empty()) {
    file.note("[COLOR TABLE] is missing; the colours are stand-ins");
    return;
  }
  const ColourRange stated = read_range(file);
  std::map<std::uint32_t, std::vector<std::uint32_t>> colours;
  std::uint32_t greatest = 0;
  for (const WifEntry& entry : table->entries) {
    const std::uint32_t number = file.key_number(*table, entry);
    const std::vector<std::uint32_t> rgb = file.whole_numbers(*table, entry, kMaxComponent);
    if (rgb.size() != 3 || number > kMaxColour) {
      file.fail(*table, entry.line,
                "colour " + entry.key + " is \"" + entry.value + "\"; write red,green,blue");
    }
    colours[number] = rgb;
    greatest = std::max({greatest, rgb[0], rgb[1], rgb[2]});
  }
  const ColourRange range = repaired_range(file, stated, greatest);
  for (const auto& [number, rgb] : colours) {
    draft.colours[number] = scaled(rgb, 0, range);
  }
}

void read_thread_looks(WifFile& file, const std::string& side, WifDraft& draft,
                       WifThreads& threads) {
  const WifSection* section = file.find(side);
  const WifSection* colours = file.find(side + " COLORS");
  ColourRange range;
  if (const WifSection* palette = file.find("COLOR PALETTE"); palette != nullptr) {
    if (palette->find("RANGE") != nullptr && !palette->find("RANGE")->value.empty()) {
      range = read_range(file);
    }
  }
  std::uint32_t common = side == "WARP" ? 1 : 2;
  const WifEntry* entry = section != nullptr ? section->find("COLOR") : nullptr;
  if (entry != nullptr && !entry->value.empty()) {
    common = colour_of(file, *section, *entry, range, draft);
  }
  threads.colours.assign(threads.count, common);
  std::vector<bool> given(threads.count, entry != nullptr && !entry->value.empty());
  if (colours != nullptr) {
    const ThreadNumbering numbering(file, *colours, threads.count);
    for (const WifEntry& colour : colours->entries) {
      const std::uint32_t thread = numbering.index(file.key_number(*colours, colour));
      if (thread < threads.count && !colour.value.empty()) {
        threads.colours[thread] = colour_of(file, *colours, colour, range, draft);
        given[thread] = true;
      }
    }
  }
  const auto missing = std::count(given.begin(), given.end(), false);
  if (missing > 0) {
    file.note(bracketed(side) + " does not say the colour of " + std::to_string(missing) + " of " +
              std::to_string(threads.count) + " threads; they take colour " +
              std::to_string(common));
  }
  for (const std::uint32_t colour :
       std::set<std::uint32_t>(threads.colours.begin(), threads.colours.end())) {
    if (draft.colours.try_emplace(colour, stand_in_colour(colour)).second &&
        file.find("COLOR TABLE") != nullptr) {
      file.note(bracketed(side) + " uses colour " + std::to_string(colour) +
                ", which [COLOR TABLE] lacks; it is a stand-in");
    }
  }
  if (section != nullptr) {
    read_lengths(file, *section, threads);
  }
}

}  // namespace weft::fabric
