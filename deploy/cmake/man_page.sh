#!/bin/sh
# Writes the man page of a program from what it says to --help, its subcommands' help included:
#   man_page.sh PROGRAM VERSION PAGE.gz
# A script of our own, because help2man does not read the lists of CLI11's help.
set -eu
PATH="$(dirname "$1"):$PATH"
HOME='~'  # so that defaults are not those of whoever builds
unset XDG_DATA_HOME
export HOME
name=$(basename "$1")
version=$2
page=$3
mkdir -p "$(dirname "$page")"

# Help on stdin, troff on stdout. kind: "program" or "command".
to_troff() {
  awk -v kind="$1" -v name="$name" -v version="$version" '
    function escape(text) {
      gsub(/\\/, "\\e", text)
      gsub(/-/, "\\-", text)
      sub(/^[.\047]/, "\\\\\\&&", text)
      return text
    }
    !described && /^[^ ]/ && !/^Usage:/ {
      described = 1
      sub("^" name ": ", "")
      if (kind == "program") {
        printf ".TH %s 1 \"\" \"litags %s\" \"User Commands\"\n", toupper(name), version
        printf ".ad l\n.nh\n"
        printf ".SH NAME\n%s \\- %s\n", escape(name), escape($0)
      } else {
        about = escape($0)
      }
      next
    }
    /^Usage:/ {
      sub(/^Usage: /, "")
      if (kind == "program") {
        printf ".SH SYNOPSIS\n.B %s\n", escape($0)
      } else {
        split($0, words, " ")
        printf ".SH COMMAND %s\n%s\n.PP\n.B %s\n", toupper(words[2]), about, escape($0)
      }
      next
    }
    /^[^ ].*:$/ {
      sub(/:$/, "")
      printf "%s %s\n", kind == "program" ? ".SH" : ".SS", kind == "program" ? toupper($0) : $0
      next
    }
    /^  [^ ]/ {
      sub(/^  /, "")
      end = match($0, /  +/)
      item = end ? substr($0, 1, end - 1) : $0
      printf ".TP\n.B %s\n", escape(item)
      if (end) print escape(substr($0, RSTART + RLENGTH))
      next
    }
    { sub(/^ +/, ""); if ($0 == "") print ".PP"; else print escape($0) }
  '
}

# A command whose help fails ends this: in a pipe nobody would see it.
help=$("$name" --help)
commands=$(printf '%s\n' "$help" | awk '/^Subcommands:/ { on = 1; next } /^[^ ]/ { on = 0 }
  on && /^  [^ ]/ { print $1 }')
printf '%s\n' "$help" | to_troff program > "$page.text"
for command in $commands; do
  help=$("$name" "$command" --help)
  printf '%s\n' "$help" | to_troff command >> "$page.text"
done
gzip -9n < "$page.text" > "$page.part"
rm "$page.text"
mv "$page.part" "$page"
