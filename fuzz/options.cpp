// Libraries of the system are built without sanitizers: what they leave in containers and on the
// heap is not ours to judge.
extern "C" const char* __asan_default_options() {
  return "detect_leaks=0:detect_container_overflow=0:allocator_may_return_null=1";
}
extern "C" const char* __ubsan_default_options() { return "print_stacktrace=1"; }
