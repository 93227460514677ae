#!/usr/bin/env python3
"""Gives docs_commands.py pages with mistakes, each of which it must find, and one without."""

import pathlib
import subprocess
import sys
import tempfile

PROGRAM = pathlib.Path(__file__).with_name("docs_commands.py")

GOOD = """\
<!-- run first, in the background until test -e there:
touch there; sleep 100
-->
```sh
word=cloth   # kept for the next block
for i in 1 2; do
  echo "$word $i of 17.5 mm"
done
```
<!-- run: prints -->
```text
cloth 1 of 3 mm
cloth ...
```
<!-- run: is the file a.toml -->
```toml
key = 1
```
<!-- run: ends with 3 -->
```sh
grep -q key a.toml
(exit 3)
```
```python
import pathlib
```
<!-- run: goes on -->
```python
assert pathlib.Path("a.toml").read_text() == "key = 1\\n"
```
<!-- run: not here, because it would fail -->
```sh
false
```
"""

# The page, and a part of what must be said of it.
BAD = {
    "a command that fails": ("```sh\ntrue\nfalse\n```\n", "page.md:3: ended with 1"),
    "the first of two that fails": ("```sh\nfalse && true\ntrue\n```\n", "page.md:2: ended with 1"),
    "one that fails in a pipe": ("```sh\nfalse | cat\n```\n", "page.md:2: ended with 1"),
    "one that does not fail": ("<!-- run: ends with 2 -->\n```sh\ntrue\n```\n", "ended with 0, not 2"),
    "an exit in the middle": ("```sh\nexit 0\n```\n\n```sh\nfalse\n```\n", "the page ended early"),
    "one that waits for words": ("```sh\nread answer\n```\n", "page.md:2: ended with 1"),
    "a service that ends": ("<!-- run: in the background until false -->\n```sh\nexit 4\n```\n", "ended before"),
    "a service that ends badly": ("<!-- run: in the background until true -->\n```sh\ntrap 'exit 6' TERM\n"
                                  "while true; do sleep 0.1; done\n```\n```sh\nsleep 1\n```\n", "ended with 6"),
    "other output": ("```sh\necho wool\n```\n<!-- run: prints -->\n```text\nsilk\n```\n", "is not printed: silk"),
    "no language": ("```\nfalse\n```\n", "a block of ''"),
    "another shell": ("```bash\nfalse\n```\n", "a block of 'bash'"),
    "no fence": ("Text:\n\n    weft run\n\n", "an indented block"),
    "a command that is only shown": ("```text\nweft run a -o b\n```\n", "a command in a block of text"),
    "no reason": ("<!-- run: not here -->\n```sh\ntrue\n```\n", "unknown mark"),
    "a mark of nothing": ("<!-- run: ends with 1 -->\n\nText.\n", "stands before no block"),
    "a block without an end": ("```sh\ntrue\n", "does not end"),
    "a test that runs it not": ("<!-- run: by tests/none.sh, in a root -->\n```sh\ntrue\n```\n",
                                "tests/none.sh does not run it"),
    "a file that is not there": ("See `docs/none.md`.\n", "there is no docs/none.md"),
    "sources that are written": ("```sh\ntouch docs/page.md.new\n```\n", "page.md:2: ended with 1"),
}


def said_of(page, folder, *words):
    (folder / "docs" / "page.md").write_text(page)
    return subprocess.run([sys.executable, PROGRAM, folder, *words], capture_output=True, text=True, timeout=60)


def main():
    wrong = []
    with tempfile.TemporaryDirectory() as name:
        folder = pathlib.Path(name)
        for made in ("docs", "examples", "tests", "build/bin"):
            (folder / made).mkdir(parents=True)
        (folder / "README.md").write_text("")
        page = (folder / "build" / "bin", "docs/page.md")
        good = said_of(GOOD, folder, *page)
        if good.returncode == 77:
            print(good.stdout)
            sys.exit(77)
        if good.returncode != 0 or "4 blocks run, 1 not" not in good.stdout:
            wrong.append(f"the page without mistakes: {good.stdout}{good.stderr}")
        for what, (text, expected) in BAD.items():
            ended = [said_of(text, folder, *page), said_of(text, folder, "--check")]
            said = "".join(one.stdout + one.stderr for one in ended)
            if not any(one.returncode == 1 for one in ended) or expected not in said:
                wrong.append(f"{what}: '{expected}' is not said: {said}")
    print(f"{1 + len(BAD)} pages, {len(wrong)} not as they should be")
    for mistake in wrong:
        print(mistake, file=sys.stderr)
    sys.exit(1 if wrong else 0)


if __name__ == "__main__":
    main()
