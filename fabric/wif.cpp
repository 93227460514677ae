#include "fabric/wif.h"

#include <algorithm>
#include <optional>

#include "fabric/draft.h"
#include "fabric/shed.h"
#include "fabric/wif_file.h"
#include "fabric/wif_shed.h"
#include "fabric/wif_threads.h"

namespace weft::fabric {
namespace {

// The sections that the specification knows; others are a program's own.
constexpr std::string_view kKnownSections =
    "|WIF|CONTENTS|TRANSLATIONS|TEXT|NOTES|WEAVING|WARP|WEFT|COLOR PALETTE|COLOR TABLE"
    "|WARP SYMBOL PALETTE|WEFT SYMBOL PALETTE|WARP SYMBOL TABLE|WEFT SYMBOL TABLE"
    "|THREADING|TIEUP|TREADLING|LIFTPLAN|WARP COLORS|WEFT COLORS|WARP SYMBOLS|WEFT SYMBOLS"
    "|WARP SPACING|WEFT SPACING|WARP SPACING ZOOM|WEFT SPACING ZOOM"
    "|WARP THICKNESS|WEFT THICKNESS|WARP THICKNESS ZOOM|WEFT THICKNESS ZOOM"
    "|BITMAP IMAGE|BITMAP FILE|";

std::string text_value(const WifFile& file, const char* section, const char* key) {
  const WifSection* found = file.find(section);
  const WifEntry* entry = found != nullptr ? found->find(key) : nullptr;
  return entry != nullptr ? entry->value : std::string();
}

// Notes whatever [WIF] and [CONTENTS] promise and the file does not keep, and the other way round.
void check_contents(WifFile& file) {
  if (file.find("WIF") == nullptr) {
    file.note("[WIF] is missing; the file was read all the same");
  }
  const WifSection* contents = file.find("CONTENTS");
  if (contents == nullptr) {
    file.note("[CONTENTS] is missing; every section that is there was read");
  } else {
    for (const WifEntry& entry : contents->entries) {
      const bool promised = file.boolean(*contents, entry, true);
      if (promised && file.find(entry.key) == nullptr) {
        file.note("[CONTENTS] promises [" + entry.key + "], which is missing");
      } else if (!promised && file.has_entries(entry.key)) {
        file.note("[CONTENTS] denies [" + entry.key + "], which is there; it was read");
      }
    }
  }
  std::string own;
  for (const WifSection& section : file.sections()) {
    if (kKnownSections.find("|" + section.name + "|") == std::string_view::npos) {
      own += (own.empty() ? "[" : ", [") + section.name + "]";
    }
  }
  if (!own.empty()) {
    file.note("not of the WIF specification and ignored: " + own);
  }
}

// Number of threads of a side, as stated or else as the longest of its sections has.
std::uint32_t thread_count(WifFile& file, const char* side,
                           const std::vector<const char*>& sections) {
  std::uint32_t line = 1;
  const std::uint32_t stated = file.stated_count(side, "THREADS", kMaxThreads, line);
  if (stated > 0) {
    return stated;
  }
  if (line > 1) {
    file.fail(line, bracketed(side) + " Threads is 0; a draft needs at least one thread");
  }
  std::uint32_t count = 0;
  for (const char* name : sections) {
    if (const WifSection* section = file.find(name); section != nullptr) {
      std::uint32_t greatest = 0;
      bool zero = false;
      for (const WifEntry& entry : section->entries) {
        const std::uint32_t key = file.key_number(*section, entry);
        greatest = std::max(greatest, key);
        zero = zero || key == 0;
      }
      count = std::max(count, greatest + (zero ? 1 : 0));
    }
  }
  if (count == 0 || count > kMaxThreads) {
    file.fail(line, bracketed(side) + " has " + std::to_string(count) +
                        " threads; a draft needs 1 to " + std::to_string(kMaxThreads) +
                        ", stated as Threads=");
  }
  file.note(bracketed(side) + " does not state its Threads; " + number_of(count, "thread") +
            " counted");
  return count;
}

}  // namespace

WifDraft read_wif(std::string_view text, const std::string& name) {
  WifFile file(text, name);
  check_contents(file);
  WifDraft draft;
  draft.title = text_value(file, "TEXT", "TITLE");
  draft.source_program = text_value(file, "WIF", "SOURCE PROGRAM");
  (void)file.required("THREADING", "a draft needs one line per end, such as 1=1");
  draft.warp.count = thread_count(file, "WARP", {"THREADING", "WARP COLORS"});
  draft.weft.count = thread_count(file, "WEFT", {"TREADLING", "LIFTPLAN", "WEFT COLORS"});
  const std::uint64_t crossings = std::uint64_t{draft.warp.count} * draft.weft.count;
  if (crossings > kMaxCrossings) {
    file.fail(1, "the draft has " + std::to_string(draft.warp.count) + " ends and " +
                     std::to_string(draft.weft.count) + " picks; at most " +
                     std::to_string(kMaxCrossings) + " crossings are possible");
  }
  draw_down(file, draft);
  read_colour_table(file, draft);
  read_thread_looks(file, "WARP", draft, draft.warp);
  read_thread_looks(file, "WEFT", draft, draft.weft);
  if (const std::optional<std::string> note = note_on_unbound(draft)) {
    file.note(*note);
  }
  draft.notes = file.notes();
  return draft;
}

}  // namespace weft::fabric
