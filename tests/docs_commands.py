#!/usr/bin/env python3
"""Runs the commands of the documentation as they are written.

    docs_commands.py SOURCE_DIR BIN_DIR [PAGE...]     runs pages, such as docs/slurm.md; default: all
    docs_commands.py SOURCE_DIR --check               reads all pages: blocks say what they are, files are there
    docs_commands.py SOURCE_DIR --print PAGE SCRIPT   prints what SCRIPT is to run of a page; with
    --where WHERE                                     only what it is to run there
    --keep FOLDER                                     keeps what PAGE wrote in FOLDER/PAGE
    --say                                             also shows the commands and what they print
    --full                                            pictures as the pages show them


The blocks of a page run in one shell, in the order of the page, in an empty folder with a view of the
sources (`examples`, `docs`, ..., and `build/bin`), with the programs on the PATH and a home of their own.
The shell has namespaces of its own (unshare): ports that nobody else has, names such as hub.example
that mean this machine, an empty /srv, sources that cannot be written, and no process that outlives it.
What commands leave open is small there (SMALL, in the home's weft.toml); with --full it is what docs/designer.md says,
and `--full --keep FOLDER docs/designer.md` draws the pictures of that page anew.
A command that does not end with 0 is a mistake. docs_blocks.py says what blocks look like and how those
that need something else are marked. Exits with 77 (skipped) where no namespaces can be had.
"""

import argparse
import os
import pathlib
import re
import shlex
import shutil
import subprocess
import sys
import tempfile
import time

import docs_blocks

SKIPPED = 77
LIMIT_S = 400
SMALL = """quality = "preview"
[preview]
pixels = 64
[render]
size = "64x64"
spp = 2
[maps]
size = 32
"""

PRELUDE = r"""
exec </dev/null
set -e -o pipefail
__background=() __background_at=()
__failed() { echo "$__at: $1"; exit 1; }
__ended() {
  local status=$?
  [ "$status" -eq 0 ] || [ "$__said" = 1 ] || echo "$__at: ended with $status"
  if [ "$status" -eq 0 ] && [ "$__whole" != 1 ]; then
    echo "$__at: the page ended early"
    exit 1
  fi
  exit "$status"
}
__is() { if [ "$1" -ne "$2" ]; then __said=1; __failed "ended with $1, not $2"; fi; }
__said=0 __whole=0
trap __ended EXIT
printed() { grep -qF -- "$*" "$__output"; }
__until() {  # PID COMMAND: waits until COMMAND succeeds.
  local end=$((SECONDS + 60))
  while [ "$SECONDS" -lt "$end" ]; do
    if ( eval "$2" ) >/dev/null 2>&1; then return 0; fi
    kill -0 "$1" 2>/dev/null || { wait "$1" || true; __said=1; __failed "ended before '$2'"; }
    sleep 0.2
  done
  __said=1
  __failed "after a minute, '$2' does not succeed"
}
stop_background() {
  local i status
  for ((i = ${#__background[@]} - 1; i >= 0; i--)); do
    kill -TERM -- "-${__background[i]}" 2>/dev/null || true
    status=0
    wait "${__background[i]}" || status=$?
    __at=${__background_at[i]}
    [ "$status" -eq 143 ] || __is "$status" 0
  done
  __background=() __background_at=()
}
"""


def pages_of(source):
    found = [source / "README.md", *sorted((source / "docs").rglob("*.md")),
             *sorted((source / "deploy").rglob("*.md"))]
    return [str(path.relative_to(source)) for path in found]


def is_whole(text):
    """Whether a shell would not ask for another line."""
    tried = subprocess.run(["bash", "-n"], input=text + "\n", capture_output=True, text=True)
    return tried.returncode == 0 and not tried.stderr


def commands_of(block):
    """The block's commands, each with the number of its line: what a shell would run at once."""
    commands, start, pending = [], block.line, []
    for number, line in enumerate(block.text.splitlines(), block.line):
        if not pending:
            start = number
            if not line.strip() or line.lstrip().startswith("#"):
                continue
        pending.append(line)
        # A last line without its end is run as well, and says what is wrong with it.
        if not line.endswith("\\") and is_whole("\n".join(pending)):
            commands.append((start, "\n".join(pending)))
            pending = []
    if pending:
        commands.append((start, "\n".join(pending)))
    return commands


class Session:
    """Writes the shell script of one page."""

    def __init__(self, page, say):
        self.page = page
        self.say = say
        self.script = [PRELUDE]
        self.python = ""  # the lines that a block which goes on begins with
        self.number = 0

    def output(self, number):
        return f"$__scratch/block_{number}"

    def add(self, block):
        """Adds a block that is to run, and returns the number of its output."""
        self.number += 1
        number = self.number
        self.script.append(f'exec 3>&1 4>&2 >"{self.output(number)}" 2>&1')
        if block.file:
            commands = [(block.line, f"cat >{block.file} <<'__FILE'\n{block.text}\n__FILE")]
        elif block.language == "python":
            self.python = f"{self.python}\n{block.text}" if block.goes_on else block.text
            lines = f"python3 - <<'__PYTHON'\n{self.python}\n__PYTHON"
            commands = [(block.line, lines)]
        else:
            commands = commands_of(block)
        if block.until:
            self.add_background(block)
        else:
            for at, (line, text) in enumerate(commands):
                last = at == len(commands) - 1
                self.add_command(f"{self.page}:{line}", text, block.status if last else 0)
        self.script.append("exec >&3 2>&4 3>&- 4>&-")
        return number

    def add_command(self, place, text, status):
        self.script.append(f"__at={shlex.quote(place)}")
        if self.say:
            shown = "\n".join("+ " + line for line in text.splitlines())
            self.script.append(f"printf '%s\\n' {shlex.quote(shown)} >&3")
        if status:
            self.script += ["set +e", text, "__status=$?", "set -e", f"__is $__status {status}"]
        else:
            self.script += [text, "__is $? 0"]

    def add_background(self, block):
        self.script += [f"__at={shlex.quote(block.place)}", f'__output="{self.output(self.number)}"', "set -m", "(", "trap - EXIT", block.text, ") &", "set +m",
                        "__background+=($!)", f"__background_at+=({shlex.quote(block.place)})",
                        f"__until $! {shlex.quote(block.until)}"]

    def text(self):
        return "\n".join([*self.script, "stop_background", "__whole=1", ""])


def view_of_sources(folder, source, bin_dir):
    """What a reader has who stands in a built checkout; the examples may be written to."""
    for entry in source.iterdir():
        if entry.name not in (".git", "build", "out", "examples"):
            (folder / entry.name).symlink_to(entry)
    shutil.copytree(source / "examples", folder / "examples")
    (folder / "build").mkdir()
    (folder / "build" / "bin").symlink_to(bin_dir)
    (folder / "build" / "python").symlink_to(bin_dir.parent / "python")


def namespaces():
    """The command that gives a shell its own, or nothing."""
    command = ["unshare", "--mount", "--net", "--uts", "--pid", "--fork", "--kill-child", "--mount-proc"]
    if os.geteuid() != 0:
        command[1:1] = ["--user", "--map-root-user"]
    works = subprocess.run([*command, "true"], capture_output=True).returncode == 0
    return command if works else None


def machine(scratch, source, names):
    """Makes the machine on which a page's commands run."""
    # Others than loopback ones, so that names of machines mean addresses that other machines reach.
    (scratch / "hosts").write_text(f"127.0.0.1 localhost\n192.0.2.1 {' '.join(names)}\n")
    quoted = shlex.quote(str(source))
    lines = ["set -e", "ip link set lo up", "ip address add 192.0.2.1/32 dev lo",
             f"mount --bind {shlex.quote(str(scratch / 'hosts'))} /etc/hosts",
             "hostname hub", "mount -t tmpfs tmpfs /srv",
             f"mount --bind {quoted} {quoted}", f"mount -o remount,bind,ro {quoted}"]
    return "\n".join(lines)


def loosely(text):
    """Text without what differs from run to run."""
    text = re.sub(r"\bj[0-9a-f]{12}\b", "JOB", text)
    text = re.sub(r"\b[0-9a-f]{12,64}\b", "DIGEST", text)
    text = re.sub(r"\d+(\.\d+)?", "#", text)
    return re.sub(r"[ \t]+", " ", text)


def lines_not_printed(expected, printed):
    """Lines of `expected` that `printed` does not have, in their order."""
    lines = [loosely(line).strip() for line in printed.splitlines()]
    missing, at = [], 0
    for line in filter(str.strip, expected.splitlines()):
        words = ".*".join(re.escape(part) for part in loosely(line).strip().split("..."))
        for place in range(at, len(lines)):
            if re.fullmatch(words, lines[place]):
                at = place + 1
                break
        else:
            missing.append(line)
    return missing


class Page:
    """One page, run and counted."""

    def __init__(self, name, arguments):
        self.source, self.bin_dir, self.name = arguments.source, arguments.bin, name
        self.say, self.keep, self.full = arguments.say, arguments.keep, arguments.full
        self.text = (self.source / name).read_text()
        self.blocks, self.mistakes = docs_blocks.read_page(name, self.text)
        self.ran = 0
        self.left = []  # of blocks that did not run: place and reason

    def environment(self, scratch):
        kept = {key: os.environ[key] for key in ("LANG", "LC_ALL", "TERM", "VK_ICD_FILENAMES") if key in os.environ}
        return {**kept, "PATH": f"{self.bin_dir}:/usr/sbin:/usr/bin:/sbin:/bin", "HOME": str(scratch / "home"),
                "TMPDIR": str(scratch / "tmp"), "USER": "ann", "__scratch": str(scratch)}

    def settings(self):
        if not self.full:
            return SMALL
        name = "docs/designer.md"
        blocks, _ = docs_blocks.read_page(name, (self.source / name).read_text())
        return next(block.text for block in blocks if block.language == "toml")

    def plan(self):
        """The script, and which outputs are held against which blocks."""
        session, shown, last = Session(self.name, self.say), [], None
        slurm = any(block.needs == "slurm" for block in self.blocks) and slurm_is_missing()
        if not slurm and any(block.needs == "slurm" for block in self.blocks):
            session.script.append(f". {shlex.quote(str(self.source / 'tests' / 'slurm_cluster.sh'))}\n"
                                  '__at="the Slurm cluster"\nSLURM_NODE_CPUS=64 start_slurm "$__scratch/slurm" >"$__scratch/slurm.log" 2>&1')
        for block in self.blocks:
            if block.prints:
                if last:
                    shown.append((last, block))
            elif block.runs:
                reason = block.reason or (slurm if block.needs == "slurm" else "")
                if block.by:
                    reason = f"{block.by} runs it, in {block.where}"
                last = None
                if reason:
                    self.left.append((block.place, reason))
                else:
                    last = session.add(block)
                    self.ran += 0 if block.hidden or block.file else 1
        return session.text(), shown

    def run(self, own):
        script, shown = self.plan()
        if self.ran == 0 or self.mistakes:
            return
        scratch = pathlib.Path(tempfile.mkdtemp(prefix="weft-docs."))
        try:
            for folder in ("home/.config/weft", "tmp", "work"):
                (scratch / folder).mkdir(parents=True)
            (scratch / "home/.config/weft/weft.toml").write_text(self.settings())
            view_of_sources(scratch / "work", self.source, self.bin_dir)
            names = sorted(set(re.findall(r"\b[a-z0-9-]+\.example\b", self.text))) + ["hub"]
            (scratch / "page.sh").write_text(script)
            (scratch / "machine.sh").write_text(
                machine(scratch, self.source, names) + f"\ncd {scratch}/work\nexec bash {scratch}/page.sh\n")
            self.call(own, scratch, shown)
            if self.keep:
                shutil.copytree(scratch / "work", self.keep / self.name.replace("/", "_"), symlinks=True,
                                dirs_exist_ok=True)
        finally:
            shutil.rmtree(scratch, ignore_errors=True)

    def call(self, own, scratch, shown):
        try:
            ended = subprocess.run([*own, "bash", scratch / "machine.sh"], text=True, timeout=LIMIT_S,
                                   env=self.environment(scratch), stdin=subprocess.DEVNULL,
                                   stdout=None if self.say else subprocess.PIPE, stderr=subprocess.STDOUT)
            said, status = ended.stdout or "", ended.returncode
        except subprocess.TimeoutExpired as late:
            said, status = f"not done after {LIMIT_S} s\n{late.stdout or ''}", 1
        outputs = sorted(scratch.glob("block_*"), key=lambda path: int(path.name[6:]))
        if self.say:
            for path in outputs:
                print(f"-- {path.name}\n{path.read_text(errors='replace')}", end="")
        if status != 0:
            tails = "".join(f"-- {path.name}\n{path.read_text(errors='replace')[-3000:]}" for path in outputs[-2:])
            self.mistakes.append(f"{said.strip()}\n{tails}".strip())
            return
        for number, block in shown:
            printed = (scratch / f"block_{number}").read_text(errors="replace")
            for line in lines_not_printed(block.text, printed):
                self.mistakes.append(f"{block.place}: is not printed: {line}\n-- printed was\n{printed}")


def slurm_is_missing():
    """Why no Slurm cluster can be started; nothing if one can."""
    script = pathlib.Path(__file__).with_name("slurm_cluster.sh")
    asked = subprocess.run(["bash", "-c", f". {shlex.quote(str(script))}; slurm_is_missing"], capture_output=True,
                           text=True)
    return asked.stdout.strip()


def check(source, names):
    """Reads pages without running anything."""
    mistakes, counts = [], {"run": 0, "elsewhere": 0, "not": 0}
    for name in names:
        text = (source / name).read_text()
        blocks, wrong = docs_blocks.read_page(name, text)
        mistakes += wrong + docs_blocks.files_that_are_not_there(name, text, source)
        for block in blocks:
            if block.language not in docs_blocks.RUN or block.hidden:
                continue
            counts["not" if block.reason else "elsewhere" if block.by else "run"] += 1
            if block.reason:
                print(f"{block.place}: not run, because {block.reason}")
            if block.by:
                script = source / block.by
                if not script.exists() or f"--print {name}" not in script.read_text():
                    mistakes.append(f"{block.place}: {block.by} does not run it")
    print(f"{len(names)} pages: {counts['run']} blocks are run here, {counts['elsewhere']} by other tests, "
          f"{counts['not']} are not run")
    return mistakes


def print_blocks(source, name, script, where):
    blocks, mistakes = docs_blocks.read_page(name, (source / name).read_text())
    found = [block for block in blocks if block.by == script and where in ("", block.where)]
    for block in found:
        print(f"# {block.place}\n{block.text}")
    return mistakes or ([] if found else [f"{name}: {script} has nothing to run there"])


def run_pages(arguments, names):
    own = namespaces()
    if own is None:
        print("no namespaces of its own can be had here (unshare)")
        sys.exit(SKIPPED)
    mistakes, ran, left = [], 0, 0
    for name in names:
        began = time.monotonic()
        page = Page(name, arguments)
        page.run(own)
        for place, reason in page.left:
            print(f"{place}: not run, because {reason}")
        print(f"{name}: {page.ran} blocks run, {len(page.left)} not, {time.monotonic() - began:.0f} s", flush=True)
        mistakes += page.mistakes
        ran, left = ran + page.ran, left + len(page.left)
    if len(names) > 1:
        print(f"{len(names)} pages: {ran} blocks run, {left} not")
    return mistakes


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("source", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("bin", nargs="?", type=lambda text: pathlib.Path(text).resolve())
    parser.add_argument("pages", nargs="*")
    parser.add_argument("--check", action="store_true")
    parser.add_argument("--print", nargs=2, metavar=("PAGE", "SCRIPT"))
    parser.add_argument("--where", default="")
    parser.add_argument("--keep", type=pathlib.Path)
    parser.add_argument("--say", action="store_true")
    parser.add_argument("--full", action="store_true")
    arguments = parser.parse_intermixed_args()
    names = arguments.pages or pages_of(arguments.source)
    if arguments.check:
        mistakes = check(arguments.source, names)
    elif arguments.print:
        mistakes = print_blocks(arguments.source, *arguments.print, arguments.where)
    elif arguments.bin:
        mistakes = run_pages(arguments, names)
    else:
        parser.error("BIN_DIR is missing")
    for mistake in mistakes:
        print(mistake, file=sys.stderr)
    sys.exit(1 if mistakes else 0)


if __name__ == "__main__":
    main()
