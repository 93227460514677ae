#pragma once

#include <functional>
#include <optional>
#include <string>
#include <vector>

#include "core/command_doc.h"

namespace weft::core {

// A word that may come next on a command line, and what it means.
struct Completion {
  std::string word;
  std::string text;
};

// What may come next. `takes_files`: any file's name may, too.
struct Completions {
  std::vector<Completion> words;
  bool takes_files = false;
};

// A place on a command line that waits for a word.
struct CompletionPlace {
  std::string command;                    // "submit"; empty for the program itself
  std::string argument;                   // "JOB", or "--coordinator"
  std::string beginning;                  // what was typed of the word so far
  std::vector<std::string> words_before;  // on the line, behind the program's name
};

// Words that are known only when they are asked for, such as names of jobs; those that do not begin
// as the place says are left out. Nothing: any file's name may stand there. Must be quick, and must
// not throw.
using CompletionSource = std::function<std::optional<Completions>(const CompletionPlace&)>;

// What may stand in place of the last of `words`, which are those behind the program's name; the
// last is what was typed of it so far.
[[nodiscard]] Completions complete(const CommandDoc& program, const std::vector<std::string>& words,
                                   const CompletionSource& source = {});

// As shells read it: WORD and its meaning with a tab between, a line each; at last ":files" or ":".
[[nodiscard]] std::string completions_text(const Completions& completions);

}  // namespace weft::core
