# Writes the fields of the LCM types of all files given as rows of a C++ table, for the checker in
# host/bus/message_check.cpp: {"TYPE", {{"field's type", "field", {"dimension", ..}}, ..}},
# A dimension is a number or the name of an earlier field. Anything but packages, comments after //
# and structs of plain fields ends it with an error.

function fail(problem) {
  printf "%s: %s: '%s'\n", FILENAME, problem, statement >"/dev/stderr"
  failed = 1
  exit 1
}

function write_field(text, words, type, dimensions, row) {
  if (text !~ /^[a-z_0-9.]+ +[a-z_A-Z0-9]+ *(\[[a-z_A-Z0-9]+\] *)*$/) fail("not a plain field")
  dimensions = ""
  if (match(text, /\[/)) {
    dimensions = substr(text, RSTART)
    text = substr(text, 1, RSTART - 1)
    gsub(/ /, "", dimensions)
    gsub(/\]\[/, "\", \"", dimensions)
    gsub(/\[/, "\"", dimensions)
    gsub(/\]/, "\"", dimensions)
  }
  split(text, words, / +/)
  printf "   {\"%s\", \"%s\", {%s}},\n", words[1], words[2], dimensions
}

{
  sub(/\/\/.*/, "")
  gsub(/[{};]/, "&\n")
  count = split($0, pieces, "\n")
  for (i = 1; i <= count; ++i) {
    statement = statement " " pieces[i]
    gsub(/[ \t]+/, " ", statement)
    sub(/^ /, "", statement)
    if (statement ~ /;$/) {
      sub(/ *;$/, "", statement)
      if (in_struct) {
        write_field(statement)
      } else if (statement !~ /^package [a-z_]+$/) {
        fail("neither a package nor a struct")
      }
      statement = ""
    } else if (statement ~ /[{]$/) {
      if (in_struct || statement !~ /^struct [a-z_0-9]+ ?[{]$/) fail("not a struct")
      split(statement, words, " ")
      printf "{\"%s\",\n  {\n", words[2]
      in_struct = 1
      statement = ""
    } else if (statement ~ /[}]$/) {
      if (statement != "}") fail("a field without its end")
      print "  }},"
      in_struct = 0
      statement = ""
    }
  }
}

END {
  if (!failed && statement !~ /^ *$/) fail("a statement without its end")
  exit failed
}
