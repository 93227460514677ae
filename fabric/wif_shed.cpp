#include "fabric/wif_shed.h"

#include <algorithm>
#include <set>

#include "fabric/draft.h"
#include "fabric/shed.h"
#include "fabric/wif_threads.h"

namespace weft::fabric {
namespace {

using Lists = NumberLists;

// What a section of lists means: its keys are `things`, its values are numbers of `parts`.
struct ListKind {
  const char* section;
  const char* thing;
  const char* part;
};

// One list per thread or treadle, zeros left out. `parts` is the greatest number that may occur; 0
// takes what occurs, and then becomes that. Keys beyond `count` are broken.
Lists read_lists(WifFile& file, const ListKind& kind, std::uint32_t count, std::uint32_t& parts) {
  const WifSection& section = *file.find(kind.section);
  const bool open = parts == 0;
  for (const WifEntry& entry : section.entries) {
    if (file.key_number(section, entry) > count && !entry.value.empty() && entry.value != "0") {
      const std::uint32_t key = file.key_number(section, entry);
      file.fail(section, entry.line,
                std::string(kind.thing) + " " + std::to_string(key) + " is beyond the " +
                    std::to_string(count) + " that the file states; correct one of the two");
    }
  }
  const ThreadNumbering numbering(file, section, count);
  Lists lists(count);
  std::vector<bool> given(count, false);
  for (const WifEntry& entry : section.entries) {
    const std::uint32_t index = numbering.index(file.key_number(section, entry));
    if (index >= count) {
      continue;
    }
    given[index] = true;
    std::set<std::uint32_t> numbers;
    for (const std::uint32_t number : file.whole_numbers(section, entry, kMaxThreads)) {
      if (!open && number > parts) {
        file.fail(section, entry.line,
                  std::string(kind.thing) + " " + entry.key + " names " + kind.part + " " +
                      std::to_string(number) + ", there are " + std::to_string(parts) +
                      "; correct it, or the number in [WEAVING]");
      }
      if (number > 0) {
        numbers.insert(number);
      }
    }
    lists[index].assign(numbers.begin(), numbers.end());
  }
  if (open) {
    for (const std::vector<std::uint32_t>& list : lists) {
      parts = std::max(parts, list.empty() ? 0 : list.back());
    }
  }
  std::size_t absent = 0;
  std::size_t empty = 0;
  for (std::size_t i = 0; i < lists.size(); ++i) {
    absent += given[i] ? 0U : 1U;
    empty += given[i] && lists[i].empty() ? 1U : 0U;
  }
  if (absent > 0) {
    file.note(bracketed(kind.section) + " leaves out " + number_of(absent, kind.thing) + "; no " +
              kind.part + " is taken for them");
  }
  if (empty > 0) {
    file.note(bracketed(kind.section) + " gives " + number_of(empty, kind.thing) + " no " +
              kind.part);
  }
  return lists;
}

// The shafts that every pick moves, from the lift plan or from the treadling and the tie-up.
Lists moved_shafts(WifFile& file, std::uint32_t picks, std::uint32_t& shafts) {
  const bool lift = file.has_entries("LIFTPLAN");
  const bool treadled = file.has_entries("TREADLING") && file.has_entries("TIEUP");
  if (lift) {
    if (treadled) {
      file.note("there are a [LIFTPLAN] and a [TREADLING]; the lift plan counts");
    }
    return read_lists(file, {"LIFTPLAN", "pick", "shaft"}, picks, shafts);
  }
  (void)file.required("TREADLING", "add it with a [TIEUP], or add a [LIFTPLAN]");
  (void)file.required("TIEUP", "[TREADLING] needs it; or add a [LIFTPLAN]");
  std::uint32_t line = 1;
  std::uint32_t treadles = file.stated_count("WEAVING", "TREADLES", kMaxThreads, line);
  const bool stated = treadles > 0;
  const Lists pressed = read_lists(file, {"TREADLING", "pick", "treadle"}, picks, treadles);
  if (!stated) {
    file.note("[WEAVING] does not state its Treadles; " + std::to_string(treadles) + " are used");
    for (const WifEntry& entry : file.find("TIEUP")->entries) {
      treadles = std::max(treadles, file.key_number(*file.find("TIEUP"), entry));
    }
  }
  if (treadles > kMaxThreads) {
    file.fail(line, "more than " + std::to_string(kMaxThreads) + " treadles");
  }
  const Lists tied = read_lists(file, {"TIEUP", "treadle", "shaft"}, treadles, shafts);
  return moved_by_treadles(pressed, tied);
}

}  // namespace

void draw_down(WifFile& file, WifDraft& draft) {
  std::uint32_t line = 1;
  std::uint32_t shafts = file.stated_count("WEAVING", "SHAFTS", kMaxThreads, line);
  const bool stated = shafts > 0;
  bool rising = true;
  if (const WifSection* weaving = file.find("WEAVING"); weaving != nullptr) {
    const WifEntry* entry = weaving->find("RISING SHED");
    if (entry != nullptr) {
      rising = file.boolean(*weaving, *entry, true);
    } else {
      file.note("[WEAVING] does not state its Rising Shed; true is taken");
    }
    if (const WifEntry* profile = weaving->find("PROFILE");
        profile != nullptr && file.boolean(*weaving, *profile, false)) {
      file.note("[WEAVING] calls this a profile draft; its blocks are read as threads");
    }
  } else {
    file.note("[WEAVING] is missing; a rising shed is taken");
  }
  (void)file.required("THREADING", "a draft needs one line per end, such as 1=1");
  const Lists threading = read_lists(file, {"THREADING", "end", "shaft"}, draft.warp.count, shafts);
  std::uint32_t moved_limit = stated ? shafts : 0;
  const Lists moved = moved_shafts(file, draft.weft.count, moved_limit);
  shafts = std::max(shafts, moved_limit);
  if (!stated) {
    file.note("[WEAVING] does not state its Shafts; " + std::to_string(shafts) + " are used");
  }
  for (std::uint32_t end = 0; end < draft.warp.count; ++end) {
    if (threading[end].size() > kMaxShaftsPerEnd) {
      file.fail(*file.find("THREADING"), file.find("THREADING")->line,
                "end " + std::to_string(end + 1) + " is on " +
                    std::to_string(threading[end].size()) + " shafts; at most " +
                    std::to_string(kMaxShaftsPerEnd) + " are possible");
    }
  }
  draw_down(Shed{threading, moved, rising}, draft);
}

}  // namespace weft::fabric
