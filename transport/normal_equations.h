#pragma once

#include <cstddef>
#include <span>

namespace weft::transport {

// Least squares of few unknowns: the upper triangle of matrix = A^T A and vector = A^T b, for A of
// `rows` rows of `width` numbers; entries below the diagonal are of no meaning. Every entry is a
// sum in the order of the rows, by fused multiply-adds: the same bits for `wide`
// (wide_is_available() said yes) or not.
// REQUIRES: width is a multiple of sixteen.
void form_normal_equations(std::span<const float> a, std::span<const float> b, std::size_t rows,
                           bool wide, std::span<float> matrix, std::span<float> vector);

// vector = A^T b alone, likewise.
void multiply_transposed(std::span<const float> a, std::span<const float> b, std::size_t rows,
                         std::span<float> vector);

// Solves (matrix + ridge) x = vector in place of `vector`, by Cholesky's factors in doubles. Reads
// the upper triangle of the first vector.size() rows and columns of `matrix`, whose rows have
// `width` numbers. REQUIRES: the matrix is positive semidefinite but for rounding below the ridge.
void solve_normal_equations(std::span<const float> matrix, std::size_t width, double ridge,
                            std::span<double> vector);

}  // namespace weft::transport
