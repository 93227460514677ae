#include "fabric/wif_file.h"

#include <algorithm>
#include <cmath>
#include <map>
#include <utility>

#include "core/error.h"
#include "core/mistakes.h"
#include "fabric/draft_text.h"

namespace weft::fabric {
namespace {

constexpr std::uint32_t kMaxKey = 1U << 24;

char upper(char c) { return c >= 'a' && c <= 'z' ? static_cast<char>(c - 'a' + 'A') : c; }

// Upper case, runs of blanks as one, and the American spelling.
std::string normalized(std::string_view text) {
  std::string result;
  for (const char c : trimmed(text)) {
    if (is_blank(c)) {
      if (result.back() != ' ') {
        result += ' ';
      }
    } else {
      result += upper(c);
    }
  }
  for (std::size_t at = result.find("COLOUR"); at != std::string::npos;
       at = result.find("COLOUR", at)) {
    result.replace(at, 6, "COLOR");
  }
  return result;
}

bool is_free_text(const std::string& section) {
  return section == "TEXT" || section == "NOTES" || section == "WIF";
}

}  // namespace

std::string bracketed(std::string_view section) {
  std::string result = "[";
  return result.append(section).append("]");
}

const WifEntry* WifSection::find(std::string_view key) const {
  const auto found = std::find_if(entries.begin(), entries.end(),
                                  [&](const WifEntry& entry) { return entry.key == key; });
  return found == entries.end() ? nullptr : &*found;
}

WifFile::WifFile(std::string_view text, std::string name) : name_(std::move(name)) {
  if (text.size() > kMaxWifBytes) {
    fail(1, "the file has " + std::to_string(text.size()) + " bytes; a draft has at most " +
                std::to_string(kMaxWifBytes));
  }
  bool was_utf16 = false;
  const std::string plain = plain_text(text, was_utf16);
  if (was_utf16) {
    note("the file is UTF-16; it was read as plain text");
  }
  for_each_line(plain, [this](std::string_view line, std::uint32_t number) {
    if (number > kMaxWifLines) {
      fail(number, "more than " + std::to_string(kMaxWifLines) + " lines; this is no draft");
    }
    read_line(line, number);
  });
  if (sections_.empty()) {
    fail(1, "the file has no [SECTION]; this is no weaving draft in WIF format");
  }
  merge_repeated_keys();
}

const WifSection* WifFile::find(std::string_view section) const {
  const auto found =
      std::find_if(sections_.begin(), sections_.end(),
                   [&](const WifSection& candidate) { return candidate.name == section; });
  return found == sections_.end() ? nullptr : &*found;
}

bool WifFile::has_entries(std::string_view section) const {
  const WifSection* found = find(section);
  return found != nullptr && !found->entries.empty();
}

const WifSection& WifFile::required(std::string_view section, const std::string& mend) const {
  const WifSection* found = find(section);
  if (found == nullptr) {
    fail(1, bracketed(section) + " is missing; " + mend);
  }
  if (found->entries.empty()) {
    fail(*found, found->line, "is empty; " + mend);
  }
  return *found;
}

std::uint32_t WifFile::stated_count(std::string_view section, std::string_view key,
                                    std::uint32_t limit, std::uint32_t& line) const {
  const WifSection* found = find(section);
  const WifEntry* entry = found != nullptr ? found->find(key) : nullptr;
  if (entry == nullptr || entry->value.empty()) {
    return 0;
  }
  line = entry->line;
  return whole_number(*found, *entry, limit);
}

void WifFile::note(std::string what) {
  if (notes_.size() < kMaxWifNotes) {
    notes_.push_back(std::move(what));
  } else if (notes_.size() == kMaxWifNotes) {
    notes_.emplace_back("more was repaired than is listed here");
  }
}

void WifFile::fail(const WifSection& section, std::uint32_t line, const std::string& what) const {
  fail(line, bracketed(section.name) + " " + what);
}

void WifFile::fail(std::uint32_t line, const std::string& what) const {
  throw core::Error(core::Code::kInvalidArgument, name_ + ":" + std::to_string(line) + ": " + what);
}

void WifFile::open_section(std::string_view line, std::uint32_t number) {
  const std::size_t close = line.find(']');
  if (close == std::string_view::npos) {
    fail(number,
         "the section name " + core::in_quotes(line) + " has no closing bracket; write [NAME]");
  }
  std::string name = normalized(line.substr(1, close - 1));
  if (name.empty()) {
    fail(number, "a section has no name; write [NAME]");
  }
  const auto found = std::find_if(sections_.begin(), sections_.end(),
                                  [&](const WifSection& s) { return s.name == name; });
  current_ = static_cast<std::size_t>(found - sections_.begin());
  if (found != sections_.end()) {
    note(bracketed(name) + " stands twice, at lines " + std::to_string(found->line) + " and " +
         std::to_string(number) + "; both were read");
    return;
  }
  constexpr std::size_t kMaxSections = 1000;
  if (sections_.size() >= kMaxSections) {
    fail(number, "more than 1000 sections; this is no weaving draft");
  }
  sections_.push_back({std::move(name), number, {}});
}

void WifFile::read_line(std::string_view line, std::uint32_t number) {
  if (line.empty() || line.front() == ';' || line.front() == '#') {
    return;
  }
  if (line.front() == '[') {
    open_section(line, number);
    return;
  }
  const std::size_t equals = line.find('=');
  if (sections_.empty()) {
    fail(number, core::in_quotes(line) +
                     " stands before the first [SECTION]; a WIF file begins with [WIF]");
  }
  WifSection& section = sections_[current_];
  if (equals == std::string_view::npos) {
    if (!is_free_text(section.name)) {
      section.entries.push_back({"", std::string(line), number});
    }
    return;
  }
  std::string_view value = line.substr(equals + 1);
  if (!is_free_text(section.name)) {
    value = value.substr(0, value.find(';'));
  }
  section.entries.push_back(
      {normalized(line.substr(0, equals)), std::string(trimmed(value)), number});
}

void WifFile::keep_entry(WifSection& section, std::map<std::string, std::size_t>& places,
                         WifEntry entry) {
  const auto [place, fresh] = places.try_emplace(entry.key, section.entries.size());
  if (fresh || entry.key.empty()) {
    section.entries.push_back(std::move(entry));
    return;
  }
  WifEntry& before = section.entries[place->second];
  if (before.value != entry.value && !is_free_text(section.name)) {
    note(bracketed(section.name) + " " + entry.key + " stands twice, at lines " +
         std::to_string(before.line) + " and " + std::to_string(entry.line) +
         "; the last one counts");
  }
  before = std::move(entry);
}

void WifFile::merge_repeated_keys() {
  for (WifSection& section : sections_) {
    std::vector<WifEntry> written;
    written.swap(section.entries);
    std::map<std::string, std::size_t> places;
    for (WifEntry& entry : written) {
      keep_entry(section, places, std::move(entry));
    }
  }
}

bool WifFile::boolean(const WifSection& section, const WifEntry& entry, bool otherwise) const {
  const std::string value = normalized(entry.value);
  if (value.empty()) {
    return otherwise;
  }
  for (const char* yes : {"TRUE", "YES", "ON", "1", "T", "Y"}) {
    if (value == yes) {
      return true;
    }
  }
  for (const char* no : {"FALSE", "NO", "OFF", "0", "F", "N"}) {
    if (value == no) {
      return false;
    }
  }
  fail(section, entry.line,
       entry.key + " is " + core::in_quotes(entry.value) + "; write true or false");
}

double WifFile::number(const WifSection& section, const WifEntry& entry) const {
  std::string text = entry.value;
  std::replace(text.begin(), text.end(), ',', '.');  // decimal comma
  const std::optional<double> value = parsed<double>(text);
  if (!value || !std::isfinite(*value)) {
    fail(section, entry.line,
         entry.key + " is " + core::in_quotes(entry.value) + "; a number is needed, such as 0.212");
  }
  return *value;
}

std::vector<std::uint32_t> WifFile::whole_numbers(const WifSection& section, const WifEntry& entry,
                                                  std::uint32_t limit) const {
  std::vector<std::uint32_t> numbers;
  std::string_view rest = entry.value;
  while (!rest.empty()) {
    const std::size_t end = std::min(rest.find_first_of(", \t"), rest.size());
    const std::string_view item = rest.substr(0, end);
    rest.remove_prefix(std::min(end + 1, rest.size()));
    if (item.empty()) {
      continue;
    }
    const std::optional<std::int64_t> value = parsed<std::int64_t>(item);
    if (!value || *value < 0 || *value > limit) {
      fail(section, entry.line,
           entry.key + "=" + core::in_quotes(entry.value) + ": " + core::in_quotes(item) +
               " is not a whole number from 0 to " + std::to_string(limit));
    }
    numbers.push_back(static_cast<std::uint32_t>(*value));
  }
  return numbers;
}

std::uint32_t WifFile::whole_number(const WifSection& section, const WifEntry& entry,
                                    std::uint32_t limit) const {
  const std::vector<std::uint32_t> numbers = whole_numbers(section, entry, limit);
  if (numbers.size() != 1) {
    fail(section, entry.line,
         entry.key + " is " + core::in_quotes(entry.value) + "; one whole number is needed");
  }
  return numbers.front();
}

std::uint32_t WifFile::key_number(const WifSection& section, const WifEntry& entry) const {
  if (entry.key.empty()) {
    fail(section, entry.line, core::in_quotes(entry.value) + " has no '='; write number=value");
  }
  const std::optional<std::uint32_t> value = parsed<std::uint32_t>(entry.key);
  if (!value || *value > kMaxKey) {
    fail(section, entry.line,
         core::in_quotes(entry.key) +
             " is no number; the keys of this section are numbers from 1 on");
  }
  return *value;
}

}  // namespace weft::fabric
