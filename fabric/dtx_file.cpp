#include "fabric/dtx_file.h"

#include <algorithm>
#include <utility>

#include "core/error.h"
#include "core/mistakes.h"
#include "fabric/draft_text.h"
#include "fabric/wif_file.h"

namespace weft::fabric {
namespace {

constexpr std::size_t kMaxSections = 1000;

std::string small_letters(std::string_view text) {
  std::string result;
  for (const char c : text) {
    result += c >= 'A' && c <= 'Z' ? static_cast<char>(c - 'A' + 'a') : c;
  }
  return result;
}

// Both spellings of the palette, and of colours, are met.
std::string key_of(std::string_view name) {
  std::string key = small_letters(trimmed(name));
  for (std::size_t at = key.find("colour"); at != std::string::npos; at = key.find("colour")) {
    key.replace(at, 6, "color");
  }
  return key == "color palette" ? "color palet" : key;
}

// Text in it is a person's, whatever it begins with.
bool is_free_text(const std::string& key) {
  return key == "description" || key == "notes" || key == "private" || key == "imprint";
}

// A number as it stands, or a comma.
struct Word {
  std::string_view text;
  std::uint32_t line;
};

std::vector<Word> words_of(const DtxSection& section) {
  std::vector<Word> words;
  for (const DtxLine& line : section.lines) {
    std::string_view rest = line.text;
    while (!rest.empty()) {
      const std::size_t end = std::max<std::size_t>(
          std::min(rest.find_first_of(", \t"), rest.size()), rest.front() == ',' ? 1 : 0);
      if (end > 0) {
        words.push_back({rest.substr(0, end), line.line});
      }
      rest.remove_prefix(std::max<std::size_t>(end, 1));  // a blank is no word
    }
  }
  return words;
}

}  // namespace

DtxFile::DtxFile(std::string_view text, std::string name) : name_(std::move(name)) {
  if (text.size() > kMaxWifBytes) {
    fail(1, "the file has " + std::to_string(text.size()) + " bytes; a draft has at most " +
                std::to_string(kMaxWifBytes));
  }
  bool was_utf16 = false;
  for_each_line(plain_text(text, was_utf16), [this](std::string_view line, std::uint32_t number) {
    if (number > kMaxWifLines) {
      fail(number, "more than " + std::to_string(kMaxWifLines) + " lines; this is no draft");
    }
    read_line(line, number);
  });
  if (sections_.empty()) {
    fail(1, "the file has no @@Section; this is no Fiberworks draft");
  }
}

void DtxFile::read_line(std::string_view line, std::uint32_t number) {
  if (line.empty()) {
    return;
  }
  if (line.starts_with("@@")) {
    const std::string_view title = trimmed(line.substr(2));
    if (find(key_of(title)) != nullptr) {
      fail(number, "@@" + std::string(title) + " stands a second time; keep one of the two");
    }
    if (sections_.size() >= kMaxSections) {
      fail(number, "more than 1000 sections; this is no weaving draft");
    }
    sections_.push_back({std::string(title), number, {}, {}});
    return;
  }
  if (sections_.empty()) {
    fail(number, core::in_quotes(line) +
                     " stands before the first section; a DTX file begins with @@StartDTX");
  }
  DtxSection& section = sections_.back();
  if (line.starts_with("%%") && !is_free_text(key_of(section.name))) {
    // A percent sign may be doubled, as printf would want it.
    const std::string_view mark =
        trimmed(line.substr(std::min(line.find_first_not_of('%'), line.size())));
    const std::size_t end = std::min(mark.find_first_of(" \t"), mark.size());
    section.marks[small_letters(mark.substr(0, end))] = {std::string(trimmed(mark.substr(end))),
                                                         number};
    return;
  }
  section.lines.push_back({std::string(line), number});
}

const DtxSection* DtxFile::find(const std::string& name) const {
  const auto found =
      std::find_if(sections_.begin(), sections_.end(),
                   [&](const DtxSection& candidate) { return key_of(candidate.name) == name; });
  return found == sections_.end() ? nullptr : &*found;
}

const DtxSection& DtxFile::required(const std::string& name, const std::string& mend) const {
  const DtxSection* found = find(name);
  if (found == nullptr) {
    fail(1, "the section @@" + name + " is missing; " + mend);
  }
  if (found->lines.empty()) {
    fail(*found, found->line, "is empty; " + mend);
  }
  return *found;
}

std::vector<DtxItem> DtxFile::items(const DtxSection& section, std::uint32_t limit) const {
  std::vector<DtxItem> items;
  bool goes_on = false;  // a comma was the last thing
  for (const Word& word : words_of(section)) {
    if (word.text == ",") {
      if (items.empty() || goes_on) {
        fail(section, word.line, "has a comma without a number before it");
      }
      goes_on = true;
      continue;
    }
    const auto number = parsed<std::uint32_t>(word.text);
    if (!number || *number > limit) {
      fail(section, word.line,
           "has " + core::in_quotes(word.text) + "; a whole number from 0 to " +
               std::to_string(limit) + " is needed");
    }
    if (!goes_on) {
      items.push_back({{}, word.line});
    }
    goes_on = false;
    items.back().numbers.push_back(*number);
  }
  if (goes_on) {
    fail(section, section.lines.back().line, "ends in a comma; a number is missing behind it");
  }
  return items;
}

std::vector<std::vector<std::uint32_t>> DtxFile::bits(const DtxSection& section,
                                                      std::uint32_t limit,
                                                      std::uint32_t& width) const {
  std::vector<std::vector<std::uint32_t>> rows;
  for (const DtxLine& line : section.lines) {
    if (rows.empty()) {
      width = static_cast<std::uint32_t>(line.text.size());
    }
    if (line.text.size() != width || line.text.size() > limit) {
      fail(section, line.line,
           "has a row of " + number_of(line.text.size(), "mark") + "; its first row has " +
               std::to_string(width) + ", and at most " + std::to_string(limit) + " are possible");
    }
    std::vector<std::uint32_t>& row = rows.emplace_back();
    for (std::uint32_t column = 0; column < width; ++column) {
      const char mark = line.text[column];
      if (mark != '0' && mark != '1') {
        fail(section, line.line,
             "has the row " + core::in_quotes(line.text) + "; write 0 and 1 only");
      }
      if (mark == '1') {
        row.push_back(column + 1);
      }
    }
  }
  return rows;
}

std::uint32_t DtxFile::stated(const std::string& key, std::uint32_t limit) const {
  const DtxSection* info = find("info");
  if (info == nullptr || !info->marks.contains(key)) {
    return 0;
  }
  const DtxLine& mark = info->marks.at(key);
  const auto number = parsed<std::uint32_t>(mark.text);
  if (!number || *number > limit) {
    fail(*info, mark.line,
         "states %%" + key + " " + core::in_quotes(mark.text) + "; a whole number from 0 to " +
             std::to_string(limit) + " is needed");
  }
  return *number;
}

void DtxFile::fail(const DtxSection& section, std::uint32_t line, const std::string& what) const {
  fail(line, "@@" + section.name + " " + what);
}

void DtxFile::fail(std::uint32_t line, const std::string& what) const {
  throw core::Error(core::Code::kInvalidArgument, name_ + ":" + std::to_string(line) + ": " + what);
}

}  // namespace weft::fabric
