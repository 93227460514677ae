#include <cstdio>
#include <map>
#include <memory>
#include <string>

#include "cli/add_command.h"
#include "cli/commands.h"

// The shells ask the program itself (`weft __complete WORDS`, core/completion.h): what they need
// beside that is little.

namespace weft::cli {

namespace {

constexpr const char* kHelp =
    "Print what makes a shell complete weft's command lines.\n"
    "For all programs of weft: commands, options, their values, and, where a coordinator answers "
    "at once, ids of jobs and names of workers, fabrics and versions. Debian's packages install "
    "it already.\n"
    "Examples: source <(weft completion bash)\n"
    "          weft completion zsh > ~/.zfunc/_weft\n"
    "          weft completion fish > ~/.config/fish/completions/weft.fish";

// bash breaks words at = : and @, too: what stands before the last of these must not come again.
constexpr const char* kBash = R"bash(# bash completion for weft
_weft() {
  local line=${COMP_LINE:0:COMP_POINT} current cut kind word text
  local -a words
  read -ra words <<<"$line"
  [[ $line == *[[:space:]] ]] && words+=("")
  current=${words[${#words[@]} - 1]}
  cut=${current%"${current##*[=:@]}"}
  COMPREPLY=()
  while IFS=$'\t' read -r word text; do
    case $word in
      :) ;;
      :files) kind=files ;;
      *) COMPREPLY+=("${word#"$cut"}") ;;
    esac
  done < <("${COMP_WORDS[0]}" __complete "${words[@]:1}" 2>/dev/null)
  if [[ $kind == files ]]; then
    compopt -o filenames 2>/dev/null
    while IFS= read -r word; do
      COMPREPLY+=("$word")
    done < <(compgen -f -- "${current#"$cut"}")
  fi
}
complete -F _weft weft weft-coordinator weft-worker weft-render
)bash";

constexpr const char* kZsh = R"zsh(#compdef weft weft-coordinator weft-worker weft-render
# zsh completion for weft
_weft() {
  local line word text kind
  local -a candidates
  while IFS= read -r line; do
    word=${line%%$'\t'*}
    text=${line#*$'\t'}
    case $line in
      :) ;;
      :files) kind=files ;;
      *) candidates+=("${word//:/\\:}:${text}") ;;
    esac
  done < <("${words[1]}" __complete "${(@Q)words[2,CURRENT]}" 2>/dev/null)
  (( ${#candidates} )) && _describe -t words 'weft' candidates
  if [[ $kind == files ]]; then
    [[ $PREFIX == --*=* ]] && compset -P '*='
    _files
  fi
}
if [[ $funcstack[1] == _weft ]]; then
  _weft "$@"
else
  compdef _weft weft weft-coordinator weft-worker weft-render
fi
)zsh";

constexpr const char* kFish = R"fish(# fish completion for weft
function __weft_complete
    set -l words (commandline --tokenize --cut-at-cursor --current-process)
    set -l current (commandline --current-token --cut-at-cursor)
    for line in ($words[1] __complete $words[2..-1] "$current" 2>/dev/null)
        switch $line
            case ':'
            case ':files'
                __fish_complete_path "$current"
            case '*'
                echo $line
        end
    end
end
for program in weft weft-coordinator weft-worker weft-render
    complete --command $program --no-files --arguments '(__weft_complete)'
end
)fish";

const std::map<std::string, const char*>& scripts() {
  static const std::map<std::string, const char*> all{
      {"bash", kBash}, {"zsh", kZsh}, {"fish", kFish}};
  return all;
}

}  // namespace

void add_completion(CLI::App& app) {
  auto shell = std::make_shared<std::string>();
  CLI::App* command = add_command(app, "completion", kHelp);
  command->add_option("shell", *shell, "Whose")
      ->required()
      ->check(CLI::IsMember({"bash", "zsh", "fish"}));
  command->callback([shell] { std::fputs(scripts().at(*shell), stdout); });
}

}  // namespace weft::cli
