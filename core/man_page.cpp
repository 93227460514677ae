#include "core/man_page.h"

#include <algorithm>

#include "core/help_text.h"
#include "core/settings.h"
#include "core/version.h"

namespace weft::core {

namespace {

// Pages are equal for equal sources: they have the date of the last thorough change, not of a
// build.
constexpr const char* kDate = "2026-11-22";

// Text as roff takes it literally.
std::string escaped(const std::string& text) {
  std::string all;
  for (const char c : text) {
    if (c == '\\') {
      all += "\\e";
    } else if (c == '-') {
      all += "\\-";
    } else if (c == '\'') {
      all += "\\(aq";
    } else if (c == '~') {
      all += "\\(ti";
    } else if (c == '^') {
      all += "\\(ha";
    } else if (c == '`') {
      all += "\\(ga";
    } else {
      all += c;
    }
  }
  return all;
}

// A line of text: one that begins with a dot is not taken for a request.
std::string line_of(const std::string& text) {
  const std::string line = escaped(text);
  return (line.starts_with('.') ? "\\&" : "") + line + "\n";
}

std::string bold(const std::string& text) { return "\\fB" + escaped(text) + "\\fR"; }
std::string italic(const std::string& text) { return "\\fI" + escaped(text) + "\\fR"; }

std::string paragraphs(const std::vector<std::string>& texts) {
  std::string all;
  for (const std::string& text : texts) {
    all += (all.empty() ? "" : ".PP\n") + line_of(text);
  }
  return all;
}

// What is said of an option ends as a sentence does.
std::string sentence(const std::string& text) {
  return text.empty() || text.ends_with('.') ? text : text + ".";
}

std::string tagged(const OptionDoc& option, bool is_argument) {
  std::string names;
  for (const std::string& name : option.names) {
    names += (names.empty() ? "" : ", ") + (is_argument ? italic(name) : bold(name));
  }
  std::string text = ".TP\n" + names;
  text += is_argument || option.value.empty() ? "" : " " + italic(option.value);
  text += "\n" + line_of(sentence(option.text));
  if (!option.choices.empty()) {
    std::string choices;
    for (const std::string& choice : option.choices) {
      choices += (choices.empty() ? "" : ", ") + bold(choice);
    }
    text += "One of " + choices + ".\n";
  }
  if (!option.default_text.empty()) {
    text += "Default: " + bold(option.default_text) + ".\n";
  }
  if (option.is_required && !is_argument) {
    text += "Required.\n";
  }
  return text;
}

std::string options_text(const CommandDoc& doc) {
  std::string text;
  for (const OptionDoc& argument : doc.arguments) {
    text += tagged(argument, true);
  }
  for (const OptionDoc& option : doc.options) {
    text += tagged(option, false);
  }
  return text;
}

std::string synopsis(const CommandDoc& doc) {
  const std::string line = usage(doc);
  return ".B " + escaped(doc.path) + "\n" + line_of(line.substr(doc.path.size() + 1));
}

// A program's commands by group, one line each.
std::string commands_list(const CommandDoc& doc) {
  std::string text = ".SH COMMANDS\n";
  for (const std::string& group : groups_of(doc)) {
    text += ".SS " + escaped(group) + "\n";
    for (const CommandDoc& command : doc.commands) {
      if (command.group == group) {
        text += ".TP\n" + bold(doc.name + "-" + command.name) + "(1)\n" + line_of(command.summary);
      }
    }
  }
  return text;
}

// The commands of a command, whole.
std::string commands_whole(const CommandDoc& doc) {
  std::string text = ".SH COMMANDS\n";
  for (const CommandDoc& command : doc.commands) {
    std::vector<std::string> texts{command.summary};
    texts.insert(texts.end(), command.text.begin(), command.text.end());
    text += ".SS " + escaped(usage(command)) + "\n" + paragraphs(texts) + options_text(command);
  }
  return text;
}

void collect_environment(const CommandDoc& doc, std::vector<const OptionDoc*>& found) {
  for (const OptionDoc& option : doc.options) {
    const bool is_new = std::none_of(found.begin(), found.end(), [&](const OptionDoc* other) {
      return other->environment == option.environment;
    });
    if (!option.environment.empty() && is_new) {
      found.push_back(&option);
    }
  }
  for (const CommandDoc& command : doc.commands) {
    collect_environment(command, found);
  }
}

std::string environment_text(const CommandDoc& doc) {
  std::vector<const OptionDoc*> variables;
  collect_environment(doc, variables);
  std::string text = ".SH ENVIRONMENT\n";
  for (const OptionDoc* option : variables) {
    text +=
        ".TP\n" + bold(option->environment) + "\nThe same as " + bold(option->names.back()) + ".\n";
  }
  return text + ".TP\n" + bold(kUserFileVariable) +
         "\nThe configuration file that is read in place of the user's.\n";
}

std::string files_text() {
  return ".SH FILES\n"
         "What the command line and the environment do not say is taken from these, the "
         "user\\(aqs\n"
         "file first; see\n.BR weft\\-config (1).\n"
         ".TP\n.I \\(ti/.config/weft/weft.toml\nThe user\\(aqs configuration.\n"
         ".TP\n.I /etc/weft/weft.toml\nThe machine\\(aqs configuration.\n";
}

std::string exit_text() {
  return ".SH EXIT STATUS\n"
         ".TP\n.B 0\nDone.\n"
         ".TP\n.B 1\nThe work failed, or an input is wrong.\n"
         ".TP\n.B 2\nThe command line, the environment or the configuration is wrong.\n"
         ".TP\n.B 3\nThere is no such file, fabric or job.\n"
         ".TP\n.B 4\nRefused: not allowed, or over a limit.\n"
         ".TP\n.B 5\nThe coordinator or a file system does not answer.\n";
}

std::string examples_text(const CommandDoc& doc) {
  std::vector<std::string> examples = doc.examples;
  if (doc.path != doc.name) {
    for (const CommandDoc& command : doc.commands) {
      examples.insert(examples.end(), command.examples.begin(), command.examples.end());
    }
  }
  if (examples.empty()) {
    return "";
  }
  std::string text = ".SH EXAMPLES\n.EX\n";
  for (const std::string& example : examples) {
    text += line_of(example);
  }
  return text + ".EE\n";
}

}  // namespace

std::string man_page_name(const CommandDoc& doc) {
  std::string name = doc.path;
  std::replace(name.begin(), name.end(), ' ', '-');
  return name;
}

std::string man_page(const CommandDoc& doc, int section) {
  const std::string name = man_page_name(doc);
  const bool is_program = doc.path == doc.name;
  std::string summary = doc.summary;
  if (summary.starts_with(name + " ")) {
    summary = summary.substr(name.size() + 1);
  }
  if (summary.ends_with('.')) {
    summary.pop_back();
  }
  std::vector<std::string> description{doc.summary};
  description.insert(description.end(), doc.text.begin(), doc.text.end());
  std::string page = ".TH \"" + escaped(name) + "\" \"" + std::to_string(section) + "\" \"" +
                     kDate + "\" \"weft " + escaped(version()) + "\" \"weft\"\n";
  page += ".SH NAME\n" + escaped(name) + " \\- " + escaped(summary) + "\n";
  page += ".SH SYNOPSIS\n" + synopsis(doc);
  page += ".SH DESCRIPTION\n" + paragraphs(description);
  if (!doc.arguments.empty() || !doc.options.empty()) {
    page += ".SH OPTIONS\n" + options_text(doc);
  }
  if (!doc.commands.empty()) {
    page += is_program ? commands_list(doc) : commands_whole(doc);
  }
  page += environment_text(doc) + files_text() + exit_text() + examples_text(doc);
  page += name == "weft" ? ".SH SEE ALSO\n.BR weft\\-coordinator (8),\n.BR weft\\-worker (8),\n"
                           ".BR weft\\-render (8)\n"
                         : ".SH SEE ALSO\n.BR weft (1)\n";
  return page;
}

}  // namespace weft::core
