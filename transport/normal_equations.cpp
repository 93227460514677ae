#include "transport/normal_equations.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include <immintrin.h>

#include "core/check.h"
#include "transport/wide.h"

namespace weft::transport {

namespace {

// A tile of the matrix stays in registers while all rows go by.
constexpr std::size_t kTileRows = 4;
constexpr std::size_t kTileColumns = 16;
constexpr std::size_t kWideTileRows = 8;

struct Rows {
  const float* a;
  std::size_t count;
  std::size_t width;
};

void add_tile(const Rows& rows, std::size_t first_row, std::size_t first_column, float* matrix) {
  __m256 sum[kTileRows][2];
  for (auto& of_row : sum) {
    of_row[0] = _mm256_setzero_ps();
    of_row[1] = _mm256_setzero_ps();
  }
  const float* a = rows.a;
  for (std::size_t i = 0; i < rows.count; ++i, a += rows.width) {
    const __m256 low = _mm256_loadu_ps(a + first_column);
    const __m256 high = _mm256_loadu_ps(a + first_column + 8);
    for (std::size_t r = 0; r < kTileRows; ++r) {
      const __m256 factor = _mm256_broadcast_ss(a + first_row + r);
      sum[r][0] = _mm256_fmadd_ps(factor, low, sum[r][0]);
      sum[r][1] = _mm256_fmadd_ps(factor, high, sum[r][1]);
    }
  }
  for (std::size_t r = 0; r < kTileRows; ++r) {
    _mm256_storeu_ps(matrix + (first_row + r) * rows.width + first_column, sum[r][0]);
    _mm256_storeu_ps(matrix + (first_row + r) * rows.width + first_column + 8, sum[r][1]);
  }
}

// kColumns sixteens of columns from first_column on.
template <std::size_t kColumns>
WEFT_WIDE void add_wide_tile(const Rows& rows, std::size_t first_row, std::size_t first_column,
                             float* matrix) {
  __m512 sum[kWideTileRows][kColumns];
  for (auto& of_row : sum) {
    for (auto& part : of_row) {
      part = _mm512_setzero_ps();
    }
  }
  const float* a = rows.a;
  for (std::size_t i = 0; i < rows.count; ++i, a += rows.width) {
    __m512 columns[kColumns];
    for (std::size_t c = 0; c < kColumns; ++c) {
      columns[c] = _mm512_loadu_ps(a + first_column + 16 * c);
    }
    for (std::size_t r = 0; r < kWideTileRows; ++r) {
      const __m512 factor = _mm512_set1_ps(a[first_row + r]);
      for (std::size_t c = 0; c < kColumns; ++c) {
        sum[r][c] = _mm512_fmadd_ps(factor, columns[c], sum[r][c]);
      }
    }
  }
  for (std::size_t r = 0; r < kWideTileRows; ++r) {
    for (std::size_t c = 0; c < kColumns; ++c) {
      _mm512_storeu_ps(matrix + (first_row + r) * rows.width + first_column + 16 * c, sum[r][c]);
    }
  }
}

void add_wide_tiles(const Rows& rows, std::size_t first_row, float* matrix) {
  std::size_t column = first_row / 16 * 16;
  for (; column + 48 <= rows.width; column += 48) {
    add_wide_tile<3>(rows, first_row, column, matrix);
  }
  if (column + 32 <= rows.width) {
    add_wide_tile<2>(rows, first_row, column, matrix);
  } else if (column < rows.width) {
    add_wide_tile<1>(rows, first_row, column, matrix);
  }
}

// Of kColumns eights of columns from `first_column` on.
template <std::size_t kColumns>
void multiply_columns(const Rows& rows, const float* b, std::size_t first_column, float* vector) {
  __m256 sum[kColumns];
  for (__m256& part : sum) {
    part = _mm256_setzero_ps();
  }
  const float* a = rows.a + first_column;
  for (std::size_t i = 0; i < rows.count; ++i, a += rows.width) {
    const __m256 factor = _mm256_broadcast_ss(b + i);
    for (std::size_t c = 0; c < kColumns; ++c) {
      sum[c] = _mm256_fmadd_ps(factor, _mm256_loadu_ps(a + 8 * c), sum[c]);
    }
  }
  for (std::size_t c = 0; c < kColumns; ++c) {
    _mm256_storeu_ps(vector + first_column + 8 * c, sum[c]);
  }
}

}  // namespace

void multiply_transposed(std::span<const float> a, std::span<const float> b, std::size_t rows,
                         std::span<float> vector) {
  const std::size_t width = vector.size();
  CHECK_EQ(width % kTileColumns, 0U);
  CHECK_LE(rows * width, a.size());
  CHECK_LE(rows, b.size());
  const Rows all{a.data(), rows, width};
  std::size_t c = 0;
  for (; c + 48 <= width; c += 48) {
    multiply_columns<6>(all, b.data(), c, vector.data());
  }
  for (; c < width; c += 16) {
    multiply_columns<2>(all, b.data(), c, vector.data());
  }
}

void form_normal_equations(std::span<const float> a, std::span<const float> b, std::size_t rows,
                           bool wide, std::span<float> matrix, std::span<float> vector) {
  const std::size_t width = vector.size();
  CHECK_EQ(width % kTileColumns, 0U);
  CHECK_LE(rows * width, a.size());
  CHECK_LE(rows, b.size());
  CHECK_EQ(matrix.size(), width * width);
  const Rows all{a.data(), rows, width};
  if (wide) {
    for (std::size_t r = 0; r < width; r += kWideTileRows) {
      add_wide_tiles(all, r, matrix.data());
    }
  } else {
    for (std::size_t r = 0; r < width; r += kTileRows) {
      for (std::size_t c = r / kTileColumns * kTileColumns; c < width; c += kTileColumns) {
        add_tile(all, r, c, matrix.data());
      }
    }
  }
  multiply_transposed(a, b, rows, vector);
}

// matrix + ridge = U^T U, row by row of U; then U^T y = vector, U x = y.
void solve_normal_equations(std::span<const float> matrix, std::size_t width, double ridge,
                            std::span<double> vector) {
  const std::size_t n = vector.size();
  std::vector<double> u(n * n);
  for (std::size_t i = 0; i < n; ++i) {
    for (std::size_t j = i; j < n; ++j) {
      u[i * n + j] = static_cast<double>(matrix[i * width + j]);
    }
    u[i * n + i] += ridge;
  }
  for (std::size_t i = 0; i < n; ++i) {
    double* row = &u[i * n];
    CHECK_GT(row[i], 0.0);
    const double per_pivot = 1 / std::sqrt(row[i]);
    for (std::size_t j = i; j < n; ++j) {
      row[j] *= per_pivot;
    }
    for (std::size_t k = i + 1; k < n; ++k) {
      const double factor = row[k];
      double* below = &u[k * n];
      for (std::size_t j = k; j < n; ++j) {
        below[j] -= factor * row[j];
      }
    }
  }
  for (std::size_t i = 0; i < n; ++i) {
    vector[i] /= u[i * n + i];
    for (std::size_t j = i + 1; j < n; ++j) {
      vector[j] -= u[i * n + j] * vector[i];
    }
  }
  for (std::size_t i = n; i-- > 0;) {
    for (std::size_t j = i + 1; j < n; ++j) {
      vector[i] -= u[i * n + j] * vector[j];
    }
    vector[i] /= u[i * n + i];
  }
}

}  // namespace weft::transport
