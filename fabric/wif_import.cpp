#include "fabric/wif_import.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <set>

#include "fabric/description_check.h"
#include "fabric/draft.h"

namespace weft::fabric {
namespace {

constexpr double kDefaultThreadsPerCm = 20;
constexpr double kLeastPitchMm = 0.03;
constexpr double kGreatestPitchMm = 20;
// Thicker yarns than this share of the pitch find no room where they cross.
constexpr double kWidestRadius = 0.42;

// Text for a comment or between quotes: one line of plain characters.
std::string plain(const std::string& text) {
  constexpr std::size_t kMost = 100;
  std::string result;
  for (const char c : text.substr(0, kMost)) {
    const bool safe = c >= 0x20 && c < 0x7f && c != '"' && c != '\\';
    result += safe ? c : '?';
  }
  return result;
}

std::string rounded(double value) {
  std::array<char, 32> digits{};
  (void)std::snprintf(digits.data(), digits.size(), "%.4g", value);
  return digits.data();
}

double linear(double srgb) {
  return srgb <= 0.04045 ? srgb / 12.92 : std::pow((srgb + 0.055) / 1.055, 2.4);
}

// Centre distance of a side's threads, from the draft or by default.
double pitch_mm(const WifThreads& threads, const char* side, std::vector<std::string>& notes) {
  if (threads.spacing_mm >= kLeastPitchMm && threads.spacing_mm <= kGreatestPitchMm) {
    return threads.spacing_mm;
  }
  notes.push_back(std::string(side) + ": " +
                  (threads.spacing_mm > 0
                       ? "a spacing of " + rounded(threads.spacing_mm) + " mm makes no cloth"
                       : std::string("the draft gives no spacing")) +
                  "; " + rounded(kDefaultThreadsPerCm) + " threads per cm are taken");
  return 10 / kDefaultThreadsPerCm;
}

double radius_mm(const WifThreads& threads, const char* side, double widest_mm,
                 std::vector<std::string>& notes) {
  if (threads.thickness_mm <= 0) {
    notes.push_back(std::string(side) + ": the draft gives no thickness; yarns of " +
                    rounded(2 * widest_mm) + " mm are taken");
    return widest_mm;
  }
  const double radius = threads.thickness_mm / 2;
  if (radius > widest_mm) {
    notes.push_back(std::string(side) + ": yarns of " + rounded(2 * radius) +
                    " mm have no room at this sett; " + rounded(2 * widest_mm) + " mm are taken");
    return widest_mm;
  }
  if (radius < widest_mm / 4) {
    notes.push_back(std::string(side) + ": yarns of " + rounded(2 * radius) +
                    " mm leave the cloth mostly open");
  }
  return std::max(radius, 0.002);
}

// One side of the cloth: which yarn a colour is.
struct Side {
  const char* role;  // "warp" or "weft"
  std::set<std::uint32_t> colours;
  double radius_mm = 0;

  [[nodiscard]] std::string yarn(std::uint32_t colour) const {
    return colours.size() == 1 ? std::string(role)
                               : std::string(role) + "_" + std::to_string(colour);
  }
};

std::string material_name(std::uint32_t colour) { return "colour_" + std::to_string(colour); }

// The cropped draft as a weave whose yarns are the colours.
v1::Weave weave_of(const WifDraft& draft, const v1::Crop& crop, const Side& warp,
                   const Side& weft) {
  v1::Weave weave;
  v1::Matrix& matrix = *weave.mutable_matrix();
  for (std::size_t pick = 0; pick < draft.weft.count; ++pick) {
    std::string& row = *matrix.add_rows();
    for (std::size_t end = 0; end < draft.warp.count; ++end) {
      row += draft.up[pick * draft.warp.count + end] != 0 ? 'X' : '.';
    }
  }
  matrix.mutable_end_colours()->Add(draft.warp.colours.begin(), draft.warp.colours.end());
  matrix.mutable_pick_colours()->Add(draft.weft.colours.begin(), draft.weft.colours.end());
  *weave.mutable_crop() = crop;
  std::set<std::uint32_t> all = warp.colours;
  all.insert(weft.colours.begin(), weft.colours.end());
  for (const std::uint32_t colour : all) {
    v1::ColourYarn& entry = *weave.add_colour_yarns();
    entry.set_colour(colour);
    if (warp.colours.contains(colour)) {
      entry.set_warp_yarn(warp.yarn(colour));
    }
    if (weft.colours.contains(colour)) {
      entry.set_weft_yarn(weft.yarn(colour));
    }
  }
  return weave;
}

std::uint32_t colour_of(const std::string& yarn, const Side& side) {
  return side.colours.size() == 1
             ? *side.colours.begin()
             : static_cast<std::uint32_t>(std::stoul(yarn.substr(yarn.rfind('_') + 1)));
}

std::string colour_list(const char* field, const std::vector<std::string>& yarns,
                        const Side& side) {
  if (side.colours.size() == 1) {
    return "";
  }
  std::string list = std::string("    ") + field + ": [";
  for (std::size_t i = 0; i < yarns.size(); ++i) {
    list += (i == 0 ? "" : ", ") + std::to_string(colour_of(yarns[i], side));
  }
  return list + "]\n";
}

std::string matrix_text(const Draft& repeat, const Side& warp, const Side& weft) {
  std::string text =
      "  # One row per pick, from the first on; X: the warp is on top.\n  matrix {\n";
  for (std::uint32_t pick = 0; pick < repeat.picks; ++pick) {
    text += "    rows: \"";
    for (std::uint32_t end = 0; end < repeat.ends; ++end) {
      text += repeat.warp_up(pick, end) ? 'X' : '.';
    }
    text += "\"\n";
  }
  text += colour_list("end_colours", repeat.end_yarns, warp);
  text += colour_list("pick_colours", repeat.pick_yarns, weft);
  return text + "  }\n";
}

std::string reference_text(const ImportOptions& options) {
  std::string text = "  wif_file: \"" + plain(options.wif_reference) + "\"\n";
  const v1::Crop& crop = options.crop;
  if (crop.ByteSizeLong() > 0) {
    text += "  # Threads are counted from 1; 0 means all the rest.\n  crop { first_end: " +
            std::to_string(crop.first_end()) + " ends: " + std::to_string(crop.ends()) +
            " first_pick: " + std::to_string(crop.first_pick()) +
            " picks: " + std::to_string(crop.picks()) + " }\n";
  }
  return text;
}

std::string yarns_by_role(const v1::Weave& weave, const Side& warp, const Side& weft) {
  std::string text;
  for (const Side* side : {&warp, &weft}) {
    if (side->colours.size() == 1) {
      text += std::string("  ") + side->role + "_yarn: \"" + side->role + "\"\n";
    }
  }
  for (const v1::ColourYarn& entry : weave.colour_yarns()) {
    std::string yarns;
    if (!entry.warp_yarn().empty() && warp.colours.size() > 1) {
      yarns += " warp_yarn: \"" + entry.warp_yarn() + "\"";
    }
    if (!entry.weft_yarn().empty() && weft.colours.size() > 1) {
      yarns += " weft_yarn: \"" + entry.weft_yarn() + "\"";
    }
    if (!yarns.empty()) {
      text += "  colour_yarns { colour: " + std::to_string(entry.colour()) + yarns + " }\n";
    }
  }
  return text;
}

std::string yarn_text(const Side& side, std::uint32_t colour) {
  return std::string("yarns {\n  name: \"") + side.yarn(colour) + "\"\n  material: \"" +
         material_name(colour) +
         "\"\n  fibres_per_ply: 60\n  yarn_radius_mm: " + rounded(side.radius_mm) +
         "\n  flattening: 0.4\n}\n";
}

std::string material_text(std::uint32_t colour, const std::array<double, 3>& srgb) {
  constexpr double kBrightest = 0.95;  // what a fibre lets through at most
  const auto rgb = [&](double base, double share) {
    std::string text = "{ r: " + rounded(base + share * linear(srgb[0]));
    text += " g: " + rounded(base + share * linear(srgb[1]));
    return text + " b: " + rounded(base + share * linear(srgb[2])) + " }\n";
  };
  return "materials {\n  name: \"" + material_name(colour) + "\"\n  c_r " + rgb(0.03, 0.07) +
         "  c_tt " + rgb(0.01, kBrightest - 0.01) +
         "  beta_r_deg: 5\n  beta_tt_deg: 12\n  gamma_tt_deg: 25\n}\n";
}

std::set<std::uint32_t> colours_of(const std::vector<std::string>& yarns, const Side& all) {
  std::set<std::uint32_t> colours;
  for (const std::string& yarn : yarns) {
    colours.insert(colour_of(yarn, all));
  }
  return colours;
}

}  // namespace

std::string name_from_file(const std::string& stem) {
  constexpr std::size_t kLongest = 64;
  std::string name;
  for (const char c : stem.substr(0, kLongest)) {
    const char small = c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
    name += is_name(std::string{'a', small}) ? small : '_';
  }
  if (is_name(name)) {
    return name;
  }
  name.insert(0, "draft");
  return is_name(name) ? name : "draft";
}

ImportedDraft import_draft(const WifDraft& draft, const ImportOptions& options) {
  ImportedDraft result;
  result.notes = draft.notes;
  Side warp{"warp", {draft.warp.colours.begin(), draft.warp.colours.end()}};
  Side weft{"weft", {draft.weft.colours.begin(), draft.weft.colours.end()}};
  Draft repeat = draft_of(weave_of(draft, options.crop, warp, weft));
  // The crop may leave fewer colours: name the yarns anew.
  const std::set<std::uint32_t> warp_left = colours_of(repeat.end_yarns, warp);
  const std::set<std::uint32_t> weft_left = colours_of(repeat.pick_yarns, weft);
  const bool same = warp_left == warp.colours && weft_left == weft.colours;
  warp.colours = warp_left;
  weft.colours = weft_left;
  WifDraft known = draft;
  if (!same) {
    for (auto* colours : {&known.warp.colours, &known.weft.colours}) {
      const std::set<std::uint32_t>& left = colours == &known.warp.colours ? warp_left : weft_left;
      for (std::uint32_t& colour : *colours) {
        colour = left.contains(colour) ? colour : *left.begin();
      }
    }
  }
  const v1::Weave weave = weave_of(known, options.crop, warp, weft);
  repeat = draft_of(weave);
  const double warp_pitch = pitch_mm(draft.warp, "warp", result.notes);
  const double weft_pitch = pitch_mm(draft.weft, "weft", result.notes);
  const double widest = kWidestRadius * std::min(warp_pitch, weft_pitch);
  warp.radius_mm = radius_mm(draft.warp, "warp", widest, result.notes);
  weft.radius_mm = radius_mm(draft.weft, "weft", widest, result.notes);

  std::string& text = result.text;
  text = "# Made by weft import from " + plain(options.draft_name) + ".\n";
  if (!draft.source_program.empty()) {
    text += "# The draft was written by " + plain(draft.source_program) + ".\n";
  }
  text +=
      "# proto-file: proto/weft/v1/fabric.proto\n"
      "# proto-message: weft.v1.FabricDescription\n";
  text += "name: \"" + options.name + "\"\n";
  text += draft.title.empty() ? "" : "comment: \"" + plain(draft.title) + "\"\n";
  text += "weave {\n";
  const bool small = repeat.ends <= kMaxInlineThreads && repeat.picks <= kMaxInlineThreads;
  result.refers = !small;
  text += small ? matrix_text(repeat, warp, weft) : reference_text(options);
  text += "  ends_per_cm: " + rounded(10 / warp_pitch) +
          "\n  picks_per_cm: " + rounded(10 / weft_pitch) + "\n";
  text += yarns_by_role(weave, warp, weft) + "}\n";
  text +=
      "# Plies, twist, hairs and loops can be added, or a published yarn taken as a whole:\n"
      "# preset: \"cotton1\" (weft new --list names them).\n";
  for (const Side* side : {&warp, &weft}) {
    for (const std::uint32_t colour : side->colours) {
      text += yarn_text(*side, colour);
    }
  }
  text += "# The draft's colours, made linear; lobe widths are those of a cotton-like fibre.\n";
  std::set<std::uint32_t> used = warp.colours;
  used.insert(weft.colours.begin(), weft.colours.end());
  for (const std::uint32_t colour : used) {
    text += material_text(colour, draft.colours.at(colour));
  }
  text +=
      "exemplar {\n  # Repeats of the draft in one tile, and the share of its fibres that is\n"
      "  # made, thicker: lower it where the tile is too large.\n"
      "  repeats_x: 1\n  repeats_y: 1\n  fibre_share: " +
      rounded(options.fibre_share) + "\n}\n";
  text +=
      "precompute {\n  quality: QUALITY_PAPER  # or QUALITY_PREVIEW, QUALITY_BEST\n}\nseed: 1\n";
  return result;
}

}  // namespace weft::fabric
