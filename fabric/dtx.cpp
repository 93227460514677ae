#include "fabric/dtx.h"

#include <algorithm>
#include <array>
#include <optional>
#include <set>
#include <utility>

#include "fabric/draft.h"
#include "fabric/draft_text.h"
#include "fabric/dtx_file.h"
#include "fabric/shed.h"
#include "fabric/wif_file.h"

namespace weft::fabric {
namespace {

// More shafts or treadles than any loom or program has.
constexpr std::uint32_t kMaxParts = 4096;
constexpr std::uint32_t kMaxColours = 1U << 16;
constexpr double kSpacingUnitMm = 0.53;
constexpr std::uint32_t kMaxSpacing = 10'000;
constexpr std::uint32_t kUsualSpacing = 4;  // of threads that a list leaves out

constexpr std::string_view kKnownSections =
    "|startdtx|description|contents|imprint|private|info|threading|tieup|treadling|liftplan"
    "|color palet|warp colors|weft colors|warp spacing|weft spacing|notes|enddtx|";

// What a section's lists are of, for messages.
struct ListKind {
  const char* thing;   // "end"
  const char* part;    // "shaft"
  const char* stated;  // key in @@Info
};

// The items of a section as lists of part numbers, zeros left out. `parts` is the greatest number
// that may occur, or 0 where the file does not say.
NumberLists lists_of(const DtxFile& file, const DtxSection& section, const ListKind& kind,
                     std::uint32_t parts) {
  NumberLists lists;
  for (const DtxItem& item : file.items(section, kMaxParts)) {
    std::set<std::uint32_t> numbers;
    for (const std::uint32_t number : item.numbers) {
      if (parts > 0 && number > parts) {
        file.fail(section, item.line,
                  std::string("gives ") + kind.thing + " " + std::to_string(lists.size() + 1) +
                      " the " + kind.part + " " + std::to_string(number) + ", there are " +
                      std::to_string(parts) + "; correct it, or %%" + kind.stated + " in @@Info");
      }
      if (number > 0) {
        numbers.insert(number);
      }
    }
    lists.emplace_back(numbers.begin(), numbers.end());
  }
  return lists;
}

void check_count(const DtxFile& file, const DtxSection& section, std::size_t found,
                 const char* thing, const char* key) {
  const std::uint32_t stated = file.stated(key, kMaxThreads);
  if (stated > 0 && stated != found) {
    file.fail(section, section.line,
              "has " + number_of(found, thing) + ", @@Info states " + std::to_string(stated) +
                  "; correct one of the two");
  }
  if (found > kMaxThreads) {
    file.fail(section, section.line,
              "has " + number_of(found, thing) + "; at most " + std::to_string(kMaxThreads) +
                  " are possible");
  }
}

// The shafts that move at every pick, and whether they rise.
NumberLists moved_shafts(const DtxFile& file, bool& rising, std::vector<std::string>& notes) {
  const DtxSection* lift = file.find("liftplan");
  if (lift != nullptr && !lift->lines.empty()) {
    if (file.find("treadling") != nullptr) {
      notes.emplace_back("there are a @@Liftplan and a @@Treadling; the lift plan counts");
    }
    std::uint32_t width = 0;
    NumberLists moved = file.bits(*lift, kMaxParts, width);
    check_count(file, *lift, moved.size(), "pick", "picks");
    rising = !lift->is_sinking();
    return moved;
  }
  const DtxSection& treadling =
      file.required("treadling", "a draft needs it with a @@Tieup, or a @@Liftplan");
  const DtxSection& tieup = file.required("tieup", "@@Treadling needs it; or add a @@Liftplan");
  std::uint32_t treadles = 0;
  NumberLists rows = file.bits(tieup, kMaxParts, treadles);
  std::reverse(rows.begin(), rows.end());  // the last row is shaft 1
  if (rows.size() > kMaxParts) {
    file.fail(tieup, tieup.line, "has more than " + std::to_string(kMaxParts) + " shafts");
  }
  NumberLists tied(treadles);
  for (std::uint32_t shaft = 1; shaft <= rows.size(); ++shaft) {
    for (const std::uint32_t treadle : rows[shaft - 1]) {
      tied[treadle - 1].push_back(shaft);
    }
  }
  const NumberLists pressed = lists_of(file, treadling, {"pick", "treadle", "treadles"}, treadles);
  check_count(file, treadling, pressed.size(), "pick", "picks");
  rising = !tieup.is_sinking();
  return moved_by_treadles(pressed, tied);
}

void read_palette(const DtxFile& file, WifDraft& draft) {
  const DtxSection* palette = file.find("color palet");
  if (palette == nullptr || palette->lines.empty()) {
    // Fiberworks leaves colours out where nobody chose any: it then shows these.
    draft.colours[1] = {1, 1, 1};
    draft.colours[2] = {0, 0, 1};
    draft.notes.emplace_back(
        "the draft has no colours; the warp is white and the weft blue, as Fiberworks shows it");
    return;
  }
  for (const DtxItem& item : file.items(*palette, 255)) {
    const auto number = static_cast<std::uint32_t>(draft.colours.size()) + 1;
    if (item.numbers.size() != 3 || number > kMaxColours) {
      file.fail(*palette, item.line,
                "colour " + std::to_string(number) + " is not red,green,blue from 0 to 255");
    }
    for (std::size_t c = 0; c < 3; ++c) {
      draft.colours[number][c] = item.numbers[c] / 255.0;
    }
  }
}

// One number for each thread of a side, `otherwise` for those that the section leaves out at its
// end; nothing when the section is missing.
std::vector<std::uint32_t> numbers_of(const DtxFile& file, const std::string& name,
                                      std::uint32_t count, std::uint32_t limit,
                                      std::optional<std::uint32_t> otherwise = {}) {
  const DtxSection* section = file.find(name);
  if (section == nullptr || section->lines.empty()) {
    return {};
  }
  std::vector<std::uint32_t> numbers;
  for (const DtxItem& item : file.items(*section, limit)) {
    numbers.insert(numbers.end(), item.numbers.begin(), item.numbers.end());
  }
  if (otherwise && numbers.size() < count) {
    numbers.resize(count, *otherwise);
  }
  if (numbers.size() != count) {
    file.fail(*section, section->line,
              "has " + number_of(numbers.size(), "number") + ", there are " +
                  number_of(count, "thread") + "; correct one of the two");
  }
  return numbers;
}

void read_looks(const DtxFile& file, const char* side, std::uint32_t otherwise, WifDraft& draft,
                WifThreads& threads) {
  const auto last = static_cast<std::uint32_t>(draft.colours.size()) - 1;
  threads.colours = numbers_of(file, std::string(side) + " colors", threads.count, kMaxColours);
  for (std::uint32_t& colour : threads.colours) {
    if (colour > last) {
      const DtxSection& section = *file.find(std::string(side) + " colors");
      file.fail(section, section.line,
                "uses colour " + std::to_string(colour) + ", the palette ends at " +
                    std::to_string(last) + " (counted from 0)");
    }
    ++colour;
  }
  if (threads.colours.empty()) {
    threads.colours.assign(threads.count, std::min(otherwise, last + 1));
    if (file.find("color palet") != nullptr) {
      draft.notes.push_back(std::string("the draft gives the ") + side +
                            " no colours; the palette's colour " + std::to_string(otherwise) +
                            " is taken");
    }
  }
  const std::vector<std::uint32_t> spacing =
      numbers_of(file, std::string(side) + " spacing", threads.count, kMaxSpacing, kUsualSpacing);
  if (spacing.empty()) {
    return;
  }
  double sum = 0;
  for (const std::uint32_t units : spacing) {
    sum += units;
    threads.even = threads.even && units == spacing.front();
  }
  threads.spacing_mm = sum / threads.count * kSpacingUnitMm;
  if (!threads.even) {
    draft.notes.push_back(std::string("the ") + side + " is spaced unevenly; its mean is used");
  }
}

void note_unknown_sections(const DtxFile& file, WifDraft& draft) {
  std::string unknown;
  for (const DtxSection& section : file.sections()) {
    if (file.find("startdtx") != &section) {
      std::string key = section.name;
      std::transform(key.begin(), key.end(), key.begin(), [](char c) {
        return c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
      });
      const bool is_known = kKnownSections.find("|" + key + "|") != std::string_view::npos ||
                            file.find("color palet") == &section;
      unknown += is_known ? "" : (unknown.empty() ? "@@" : ", @@") + section.name;
    }
  }
  if (!unknown.empty()) {
    draft.notes.push_back("not known and ignored: " + unknown);
  }
}

std::string first_line(const DtxFile& file, const char* section) {
  const DtxSection* found = file.find(section);
  return found != nullptr && !found->lines.empty() ? found->lines.front().text : std::string();
}

}  // namespace

WifDraft read_dtx(std::string_view text, const std::string& name) {
  const DtxFile file(text, name);
  WifDraft draft;
  draft.title = first_line(file, "description");
  draft.source_program = "Fiberworks";
  if (const std::string imprint = first_line(file, "imprint"); !imprint.empty()) {
    draft.source_program += " (" + imprint + ")";
  }
  Shed shed;
  const DtxSection& threading = file.required("threading", "a draft needs the shaft of every end");
  shed.threading =
      lists_of(file, threading, {"end", "shaft", "shafts"}, file.stated("shafts", kMaxParts));
  check_count(file, threading, shed.threading.size(), "end", "ends");
  shed.moved = moved_shafts(file, shed.rising, draft.notes);
  draft.warp.count = static_cast<std::uint32_t>(shed.threading.size());
  draft.weft.count = static_cast<std::uint32_t>(shed.moved.size());
  if (std::uint64_t{draft.warp.count} * draft.weft.count > kMaxCrossings) {
    file.fail(1, "the draft has " + std::to_string(draft.warp.count) + " ends and " +
                     std::to_string(draft.weft.count) + " picks; at most " +
                     std::to_string(kMaxCrossings) + " crossings are possible");
  }
  for (std::size_t end = 0; end < shed.threading.size(); ++end) {
    if (shed.threading[end].size() > kMaxShaftsPerEnd) {
      file.fail(threading, threading.line,
                "puts end " + std::to_string(end + 1) + " on more than " +
                    std::to_string(kMaxShaftsPerEnd) + " shafts");
    }
  }
  draw_down(shed, draft);
  read_palette(file, draft);
  read_looks(file, "warp", 1, draft, draft.warp);
  read_looks(file, "weft", 2, draft, draft.weft);
  note_unknown_sections(file, draft);
  if (std::optional<std::string> note = note_on_unbound(draft)) {
    draft.notes.push_back(std::move(*note));
  }
  return draft;
}

bool looks_like_dtx(std::string_view text) {
  bool was_utf16 = false;
  const std::string begin =
      plain_text(text.substr(0, std::min<std::size_t>(text.size(), 256)), was_utf16);
  return std::string_view(begin)
      .substr(std::min(begin.find_first_not_of(" \t\r\n"), begin.size()))
      .starts_with("@@");
}

}  // namespace weft::fabric
