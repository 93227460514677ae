#pragma once

#include <xmmintrin.h>

namespace weft::transport {

// While it lives, its thread flushes denormals to zero, as Embree wants it; the mode before is
// restored. Cheap enough for every ray: two instructions when the mode is set already.
class FlushDenormals {
 public:
  FlushDenormals() : before_(_mm_getcsr()) {
    if ((before_ & kFlush) != kFlush) {
      _mm_setcsr(before_ | kFlush);
    }
  }
  ~FlushDenormals() {
    if ((before_ & kFlush) != kFlush) {
      _mm_setcsr(before_);
    }
  }
  FlushDenormals(const FlushDenormals&) = delete;
  FlushDenormals& operator=(const FlushDenormals&) = delete;
  FlushDenormals(FlushDenormals&&) = delete;
  FlushDenormals& operator=(FlushDenormals&&) = delete;

 private:
  static constexpr unsigned kFlush = 0x8040;  // flush to zero, denormals are zero
  unsigned before_;
};

}  // namespace weft::transport
