"""The blocks of a page of the documentation, in the order in which a reader meets them.

A fenced block says what it is: `sh` and `python` are run by docs_commands.py, `text`, `toml` and the
others below are shown. What a block needs beyond that is said in HTML comments right before it, which
readers do not see:

    <!-- run: in the background until COMMAND -->   goes on while the rest of the page runs; that begins
                                                    when COMMAND succeeds; `printed TEXT` does when the
                                                    block has printed TEXT
    <!-- run: ends with N -->                       the last command of the block ends with this status
    <!-- run: needs slurm -->                       runs on a Slurm cluster of this machine, where one can
                                                    be started (tests/slurm_cluster.sh)
    <!-- run: by tests/SCRIPT, in WHERE -->         runs there: the script asks docs_commands.py --print
    <!-- run: not here, because REASON -->          does not run at all
    <!-- run: goes on -->                           of python: the lines above it run before it again
    <!-- run: prints -->                            of text: what the block before it prints; numbers may
                                                    differ, and `...` stands for anything
    <!-- run: is the file NAME -->                  of what is shown: it is written to NAME

What readers are told in words, or have already, is made by commands that they do not see; there,
`stop_background` stops all that goes on:

    <!-- run first:
    COMMANDS
    -->
    <!-- run first, in the background until COMMAND:
    COMMANDS
    -->
"""

import dataclasses
import re

RUN = {"sh", "python"}
SHOWN = {"text", "toml", "textproto", "yaml", "json", "cpp", "glsl", "proto", "cmake", "dockerfile"}

FENCE = re.compile(r"^(\s*)(```+|~~~+)\s*(\S*)\s*$")
MARK = re.compile(r"^\s*<!--\s*run:\s*(.*?)\s*-->\s*$")
FIRST = re.compile(r"^\s*<!--\s*run first(?:, in the background until (\S.*))?:\s*$")
LIST_ITEM = re.compile(r"^\s*([-*+]|\d+[.)])\s")
# What only a command line begins with.
COMMAND = re.compile(r"^(\$ |sudo |weft [a-z]+ .*(-o|--[a-z])|weft-(coordinator|worker|render) --|"
                     r"(apt|apt-get|kubectl|systemctl|cmake|podman|sbatch|squeue) [a-z-])")


@dataclasses.dataclass
class Block:
    page: str
    line: int  # of its first line of text
    language: str
    text: str
    hidden: bool = False
    reason: str = ""  # why it does not run, if not empty
    by: str = ""  # which script runs it, if not this one
    where: str = ""  # in what that script calls the place
    needs: str = ""
    until: str = ""
    status: int = 0
    goes_on: bool = False
    prints: bool = False
    file: str = ""  # what it is to be written to

    @property
    def runs(self):
        return self.language in RUN or self.file != ""

    @property
    def place(self):
        return f"{self.page}:{self.line}"


def apply_mark(block, mark):
    """Returns what is wrong with the mark, or nothing."""
    if matched := re.fullmatch(r"not here, because (\S.*)", mark):
        block.reason = matched[1]
    elif matched := re.fullmatch(r"by (tests/\S+), in (\S.*)", mark):
        block.by, block.where = matched[1], matched[2]
    elif matched := re.fullmatch(r"in the background until (\S.*)", mark):
        block.until = matched[1]
    elif matched := re.fullmatch(r"ends with (\d+)", mark):
        block.status = int(matched[1])
    elif mark == "needs slurm":
        block.needs = "slurm"
    elif mark == "goes on" and block.language == "python":
        block.goes_on = True
    elif mark == "prints" and block.language == "text":
        block.prints = True
    elif (matched := re.fullmatch(r"is the file (\S+)", mark)) and block.language in SHOWN:
        block.file = matched[1]
    else:
        return f"{block.place}: unknown mark 'run: {mark}' for a block of {block.language}"
    return ""


class Reader:
    """Goes through one page once."""

    def __init__(self, page, text):
        self.page = page
        self.lines = text.splitlines()
        self.blocks = []
        self.mistakes = []
        self.marks = []
        self.in_list = False

    def read(self):
        at = 0
        while at < len(self.lines):
            line = self.lines[at]
            if matched := MARK.match(line):
                self.marks.append((at + 1, matched[1]))
                at += 1
            elif matched := FIRST.match(line):
                at = self.hidden(at, matched[1] or "")
            elif matched := FENCE.match(line):
                at = self.fenced(at, matched)
            else:
                self.prose(at, line)
                at += 1
        self.refuse_marks()
        return self.blocks, self.mistakes

    def refuse_marks(self):
        for line, mark in self.marks:
            self.mistakes.append(f"{self.page}:{line}: 'run: {mark}' stands before no block")
        self.marks = []

    def prose(self, at, line):
        if not line.strip():
            return
        self.refuse_marks()
        indent = len(line) - len(line.lstrip())
        after_blank = at == 0 or not self.lines[at - 1].strip()
        if LIST_ITEM.match(line):
            self.in_list = True
        elif indent == 0:
            self.in_list = False
        if after_blank and indent >= (6 if self.in_list else 4):
            self.mistakes.append(f"{self.page}:{at + 1}: an indented block: fence it, and say what it is")

    def hidden(self, at, until):
        end = at + 1
        while end < len(self.lines) and self.lines[end].strip() != "-->":
            end += 1
        if end == len(self.lines):
            self.mistakes.append(f"{self.page}:{at + 1}: the comment does not end")
        text = "\n".join(self.lines[at + 1:end])
        self.append(Block(self.page, at + 2, "sh", text, hidden=True, until=until))
        return end + 1

    def fenced(self, at, matched):
        indent, fence, language = len(matched[1]), matched[2], matched[3]
        end = at + 1
        while end < len(self.lines) and self.lines[end].strip() != fence:
            end += 1
        text = [line[min(indent, len(line) - len(line.lstrip())):] for line in self.lines[at + 1:end]]
        block = Block(self.page, at + 2, language, "\n".join(text))
        if end == len(self.lines):
            self.mistakes.append(f"{self.page}:{at + 1}: the block does not end")
        if language not in RUN | SHOWN:
            known = ", ".join(sorted(RUN | SHOWN))
            self.mistakes.append(f"{self.page}:{at + 1}: a block of '{language}'; it may be one of {known}")
        self.append(block)
        if language in SHOWN and not block.prints:
            for line in text:
                if COMMAND.match(line):
                    self.mistakes.append(f"{block.place}: a command in a block of {language}: {line}")
        return end + 1

    def append(self, block):
        for _, mark in self.marks:
            if mistake := apply_mark(block, mark):
                self.mistakes.append(mistake)
        self.marks = []
        self.blocks.append(block)


# A file of ours that the prose names.
NAMED_FILE = re.compile(r"`([\w.-]+/[\w./-]+\.(?:h|cpp|comp|md|sh|py|proto|textproto|yaml|txt|js|json))`")


def files_that_are_not_there(page, text, source):
    """Sentences about files of the source tree that the page names and that do not exist."""
    mistakes = []
    for number, line in enumerate(text.splitlines(), 1):
        for name in NAMED_FILE.findall(line):
            ours = (source / name.split("/")[0]).is_dir() and not name.startswith(("build/", "out/"))
            if ours and not (source / name).exists() and "generated" not in line:
                mistakes.append(f"{page}:{number}: there is no {name}")
    return mistakes


def read_page(page, text):
    """The blocks of a page, and sentences about what is wrong with them."""
    return Reader(page, text).read()
