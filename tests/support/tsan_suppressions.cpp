// GLib's mutexes are futexes that ThreadSanitizer does not recognize. Data that liblcm passes
// between threads under them looks like a race. Visible: the sanitizer is a shared library.
extern "C" const char* __tsan_default_suppressions();  // NOLINT(bugprone-reserved-identifier)
extern "C" [[gnu::visibility("default")]] const char*
__tsan_default_suppressions() {  // NOLINT(bugprone-reserved-identifier)
  return "called_from_lib:libglib-2.0.so.0\ncalled_from_lib:liblcm.so.1\n";
}
