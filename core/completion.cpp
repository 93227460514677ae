#include "core/completion.h"

#include <algorithm>

namespace weft::core {

namespace {

const OptionDoc* find_option(const CommandDoc& command, const std::string& name) {
  const auto found = std::find_if(command.options.begin(), command.options.end(),
                                  [&](const OptionDoc& doc) { return doc.is_called(name); });
  return found == command.options.end() ? nullptr : &*found;
}

// Where a command line stands after the words that are complete.
struct Position {
  const CommandDoc* command = nullptr;
  const OptionDoc* awaiting = nullptr;  // an option whose value comes next
  std::size_t arguments = 0;            // that were given
  bool are_options_over = false;        // behind "--"
};

void step(Position& position, const std::string& word) {
  if (position.awaiting != nullptr) {
    position.awaiting = nullptr;
  } else if (word == "--") {
    position.are_options_over = true;
  } else if (!position.are_options_over && word.starts_with('-')) {
    const OptionDoc* option = find_option(*position.command, word);
    position.awaiting = option != nullptr && !option->value.empty() ? option : nullptr;
  } else if (const CommandDoc* command = position.command->find(word); command != nullptr) {
    position.command = command;
  } else {
    ++position.arguments;
  }
}

bool begins(const std::string& word, const std::string& beginning) {
  return word.starts_with(beginning);
}

void add_values(const OptionDoc& option, const CompletionPlace& place,
                const CompletionSource& source, Completions& found) {
  for (const std::string& choice : option.choices) {
    if (begins(choice, place.beginning)) {
      found.words.push_back({choice, ""});
    }
  }
  if (!option.choices.empty() || option.is_number) {
    return;
  }
  const auto known = source ? source(place) : std::nullopt;
  if (!known) {
    found.takes_files = true;
    return;
  }
  found.takes_files = known->takes_files;
  for (const Completion& word : known->words) {
    if (begins(word.word, place.beginning)) {
      found.words.push_back(word);
    }
  }
}

void add_options(const CommandDoc& command, const std::string& beginning, Completions& found) {
  for (const OptionDoc& option : command.options) {
    for (const std::string& name : option.names) {
      const bool is_worth_it = name.size() > 2 || beginning == "-";
      if (is_worth_it && begins(name, beginning)) {
        found.words.push_back({name, option.text});
      }
    }
  }
}

}  // namespace

Completions complete(const CommandDoc& program, const std::vector<std::string>& words,
                     const CompletionSource& source) {
  Completions found;
  if (words.empty()) {
    return found;
  }
  Position position{&program, nullptr, 0, false};
  for (std::size_t i = 0; i + 1 < words.size(); ++i) {
    step(position, words[i]);
  }
  const std::string& last = words.back();
  const CommandDoc& command = *position.command;
  CompletionPlace place{&command == &program ? "" : command.path.substr(program.path.size() + 1),
                        "",
                        last,
                        {words.begin(), words.end() - 1}};
  const std::size_t equals = last.find('=');
  if (position.awaiting != nullptr) {
    place.argument = position.awaiting->names.back();
    add_values(*position.awaiting, place, source, found);
  } else if (!position.are_options_over && last.starts_with("--") && equals != std::string::npos) {
    const std::string name = last.substr(0, equals);
    if (const OptionDoc* option = find_option(command, name); option != nullptr) {
      place.argument = option->names.back();
      place.beginning = last.substr(equals + 1);
      add_values(*option, place, source, found);
      for (Completion& word : found.words) {
        word.word = name + "=" + word.word;
      }
    }
  } else if (!position.are_options_over && last.starts_with('-')) {
    add_options(command, last, found);
  } else if (!command.commands.empty()) {
    for (const CommandDoc& sub : command.commands) {
      if (begins(sub.name, last)) {
        found.words.push_back({sub.name, sub.summary});
      }
    }
  } else if (position.arguments < command.arguments.size() ||
             (!command.arguments.empty() && command.arguments.back().is_repeated)) {
    const OptionDoc& argument =
        command.arguments[std::min(position.arguments, command.arguments.size() - 1)];
    place.argument = argument.names.front();
    add_values(argument, place, source, found);
  }
  return found;
}

std::string completions_text(const Completions& completions) {
  std::string text;
  for (const Completion& completion : completions.words) {
    text += completion.word + "\t" + completion.text + "\n";
  }
  return text + (completions.takes_files ? ":files\n" : ":\n");
}

}  // namespace weft::core
