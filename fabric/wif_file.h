#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "fabric/draft_text.h"

namespace weft::fabric {

// A Weaving Information File as it stands: sections of "key=value" lines, each with its line
// number. What the sections mean is fabric/wif.h's business.

struct WifEntry {
  std::string key;    // upper case, blanks collapsed, "COLOUR" spelt "COLOR"
  std::string value;  // trimmed; without a comment behind it, except in free text
  std::uint32_t line = 0;
};

struct WifSection {
  std::string name;  // as WifEntry::key
  std::uint32_t line = 0;
  std::vector<WifEntry> entries;  // keys differ; of a repeated key the last value stands

  [[nodiscard]] const WifEntry* find(std::string_view key) const;
};

class WifFile {
 public:
  // Reads the text of a file called `name`. Takes CR, LF and CRLF, a byte order mark, UTF-16, any
  // single-byte or UTF-8 text, comments, and repeated sections (merged). Throws
  // core::Error(kInvalidArgument) as "name:line: ..." when the text is no INI file.
  WifFile(std::string_view text, std::string name);

  [[nodiscard]] const std::string& name() const { return name_; }
  [[nodiscard]] const std::vector<WifSection>& sections() const { return sections_; }
  [[nodiscard]] const WifSection* find(std::string_view section) const;
  [[nodiscard]] bool has_entries(std::string_view section) const;
  // The section, which has entries. Throws by fail, ending in `mend`, when it is missing or empty.
  [[nodiscard]] const WifSection& required(std::string_view section, const std::string& mend) const;
  // The whole number of `key` in a section, and its line; 0 when it is not stated.
  [[nodiscard]] std::uint32_t stated_count(std::string_view section, std::string_view key,
                                           std::uint32_t limit, std::uint32_t& line) const;
  [[nodiscard]] const std::vector<std::string>& notes() const { return notes_; }

  // Adds a line to the import report: what was repaired or defaulted.
  void note(std::string what);

  // Throws core::Error(kInvalidArgument): "name:line: [SECTION] what; how to mend it".
  [[noreturn]] void fail(const WifSection& section, std::uint32_t line,
                         const std::string& what) const;
  // The same for a mistake that stands in no section.
  [[noreturn]] void fail(std::uint32_t line, const std::string& what) const;

  // The values of an entry. Each throws, by fail, when the value is not of its kind.
  // An empty one gives `otherwise`.
  [[nodiscard]] bool boolean(const WifSection& section, const WifEntry& entry,
                             bool otherwise) const;
  // A finite number.
  [[nodiscard]] double number(const WifSection& section, const WifEntry& entry) const;
  // Whole numbers from 0 to `limit`, divided by commas or blanks; empty items are left out.
  [[nodiscard]] std::vector<std::uint32_t> whole_numbers(const WifSection& section,
                                                         const WifEntry& entry,
                                                         std::uint32_t limit) const;
  // Exactly one of them.
  [[nodiscard]] std::uint32_t whole_number(const WifSection& section, const WifEntry& entry,
                                           std::uint32_t limit) const;
  // The thread, shaft or treadle number that is an entry's key: a whole number.
  [[nodiscard]] std::uint32_t key_number(const WifSection& section, const WifEntry& entry) const;

 private:
  void read_line(std::string_view line, std::uint32_t number);
  void open_section(std::string_view line, std::uint32_t number);
  void merge_repeated_keys();
  // Appends an entry to its section, or replaces the one of the same key; `places` says where each
  // key stands.
  void keep_entry(WifSection& section, std::map<std::string, std::size_t>& places, WifEntry entry);

  std::string name_;
  std::vector<WifSection> sections_;
  std::vector<std::string> notes_;
  std::size_t current_ = 0;  // index into sections_, valid once there is one
};

// "[NAME]".
[[nodiscard]] std::string bracketed(std::string_view section);

// Largest file, in bytes and in lines, and most lines in the import report.
inline constexpr std::uint64_t kMaxWifBytes = std::uint64_t{16} << 20;
inline constexpr std::uint32_t kMaxWifLines = 1U << 20;
inline constexpr std::size_t kMaxWifNotes = 200;

}  // namespace weft::fabric
