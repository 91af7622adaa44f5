"""tests/lint/words finds texts that are not plain English."""

import unittest

from generated_tree import load


class Words(unittest.TestCase):
    def setUp(self):
        self.words = load("words")

    def faults(self, markdown: str) -> list[int]:
        """Lines with a fault."""
        return [number for number, _ in self.words.markdown_findings(markdown)]

    def test_sentences_open_with_their_subject(self):
        for opening in ("What is left stays.", "Whether it runs is shown.", "**Who** stops it waits.", "Of these two stay."):
            self.assertEqual(self.faults(f"A page.\n\nA sentence. {opening}\n"), [3], opening)
            self.assertEqual(self.faults(f"- {opening}\n- Another.\n"), [1], opening)
        self.assertEqual(self.faults("What is it? Whatever it is, it stays.\nNot of these.\n"), [])
        self.assertEqual(self.faults("# What is new\n\n```\nWhat is left stays.\n```\n\n    Of code\n"), [])

    def test_cells_open_with_their_subject(self):
        self.assertEqual(self.faults("| key | text |\n|---|---|\n| a | of one count |\n| b | one count |\n"), [3])
        self.assertEqual(self.faults("| `what` | the name |\n| a | `// What is in it.` |\n"), [])

    def test_long_sentences(self):
        limit = self.words.MOST_WORDS
        sentence = " ".join(["word"] * limit)
        self.assertEqual(self.faults(f"First.\n\n{sentence}.\n"), [])
        self.assertEqual(self.faults(f"First.\n\n{sentence} more.\n"), [3])
        # Line breaks do not end a sentence; full stops, paragraphs and list items do.
        self.assertEqual(self.faults(f"A\n{sentence}.\n"), [1])
        self.assertEqual(self.faults(f"{sentence}. `code` is short: {sentence[:40]}.\n"), [])
        self.assertEqual(self.faults(f"- {sentence}\n- {sentence}\n\n{sentence}\n"), [])
        # A code phrase is one word. Tables, code, headings, pictures and lists of links may be longer.
        self.assertEqual(self.faults(f"`{sentence}` is `{sentence}`.\n"), [])
        links = " ".join(["[word](a.md)"] * (limit + 1))
        self.assertEqual(self.faults(f"| {sentence} more |\n\n# {sentence} more\n\n![{sentence} more](a.svg)\n\n{links}\n\n"
                                     f"```\n{sentence} more\n```\n\n    {sentence} more\n"), [])
        self.assertEqual(self.faults(f"{links} and more text.\n"), [1])

    def test_long_sentences_of_comments(self):
        def lines(text: str) -> list[int]:
            return [number for number, _ in self.words.long_comments(text)]

        half = " ".join(["word"] * (self.words.MOST_WORDS // 2))
        self.assertEqual(lines(f"int a;\n// {half}\n// {half}.\n"), [])
        for mark in ("//", "  ///", "#"):
            self.assertEqual(lines(f"int a;\n{mark} {half}\n{mark} {half} more.\n"), [2], mark)
        # Another sentence, another comment, a figure, a table and a line about the usage.
        self.assertEqual(lines(f"// {half}. {half.capitalize()} more.\n"), [])
        self.assertEqual(lines(f"// {half}\n\n// {half} more.\n"), [])
        self.assertEqual(lines(f"//   {half} {half} more\n// a  {half} {half}\n// {half}\n// usage: {half} more\n"), [])

    def test_comments_and_test_names(self):
        def lines(text: str) -> list[int]:
            return [number for number, _ in self.words.source_findings(text, comments=True, names=True)]

        for text in ("// What is left.", "  /// Of each plane.", "# Whether it runs.", 'TEST_CASE("What is refused", "[a]") {',
                     'SECTION("of the image") {', "    def test_what_is_refused(self):", 'test("of ten pages", async () => {',
                     "// Let d be the depth.", "/** How many differ. */", "# Where it ends.", "  ///< That curve.",
                     "def test_where_it_ends(self):", 'SECTION("which it finds") {'):
            self.assertEqual(lines(f"int a;\n{text}\n"), [2], text)
        for text in ("// The remaining part, of what is left.", 'TEST_CASE("Offers are refused") {', "double a = 0;  ///< of the wire",
                     "def test_whatever(self):", 'latest("of", 1);', "// Letters that are left.", "// thatched", "def test_however(self):"):
            self.assertEqual(lines(f"int a;\n{text}\n"), [], text)

    def test_words_that_hide_a_meaning(self):
        def lines(text: str) -> list[int]:
            return [number for number, _ in self.words.word_findings(text)]

        self.assertEqual(lines("It starts.\nIt starts Anew.\nthe toldest\n"), [2])
        for text in ("a port that is none", "for want of files", "the same of a curve", "a slope is had", "which is said once",
                     "thereby", "whoever asks", "none is given", "thereof"):
            self.assertEqual(lines(text), [1], text)
        # Code phrases quote words. Other words may contain them, and other words may be between.
        self.assertEqual(lines("`for want of files` becomes\nthe same offset\nthat is not one\nit is hadron\nsaidness"), [])


if __name__ == "__main__":
    unittest.main()
