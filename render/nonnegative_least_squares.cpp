#include "render/nonnegative_least_squares.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <limits>

#include <Eigen/Cholesky>
#include <Eigen/Core>

#include "core/check.h"

namespace weft::render {
namespace {

using Vector = Eigen::VectorXd;
using Matrix = Eigen::MatrixXd;

// Columns are scaled to length 1; a share of this on the diagonal keeps the factorisation of nearly
// equal columns sound.
constexpr double kRidge = 1e-12;
constexpr double kTolerance = 1e-10;  // of a gradient, against the largest projection

// Least squares over the chosen columns alone; 0 elsewhere.
Vector solve_among(const Matrix& gram, const Vector& projected, const std::vector<bool>& chosen) {
  std::vector<Eigen::Index> places;
  for (Eigen::Index i = 0; i < projected.size(); ++i) {
    if (chosen[static_cast<std::size_t>(i)]) {
      places.push_back(i);
    }
  }
  const auto n = static_cast<Eigen::Index>(places.size());
  if (n == 0) {
    return Vector::Zero(projected.size());
  }
  Matrix part(n, n);
  Vector right(n);
  for (Eigen::Index i = 0; i < n; ++i) {
    const Eigen::Index from = places[static_cast<std::size_t>(i)];
    right(i) = projected(from);
    for (Eigen::Index j = 0; j < n; ++j) {
      part(i, j) = gram(from, places[static_cast<std::size_t>(j)]);
    }
    part(i, i) += kRidge;
  }
  const Vector solved = part.ldlt().solve(right);
  Vector whole = Vector::Zero(projected.size());
  for (Eigen::Index i = 0; i < n; ++i) {
    whole(places[static_cast<std::size_t>(i)]) = solved(i);
  }
  return whole;
}

// Moves x towards `wanted` until a chosen entry becomes 0, which is then chosen no longer. False
// when it got all the way.
bool step_to_bound(Vector& x, const Vector& wanted, std::vector<bool>& chosen) {
  double share = std::numeric_limits<double>::infinity();
  Eigen::Index first = -1;
  for (Eigen::Index i = 0; i < x.size(); ++i) {
    if (chosen[static_cast<std::size_t>(i)] && wanted(i) <= 0) {
      const double reach = x(i) / std::max(x(i) - wanted(i), 1e-300);
      if (reach < share) {
        share = reach;
        first = i;
      }
    }
  }
  if (first < 0) {
    x = wanted;
    return false;
  }
  x += share * (wanted - x);
  x(first) = 0;
  chosen[static_cast<std::size_t>(first)] = false;
  return true;
}

}  // namespace

std::vector<double> nonnegative_least_squares(std::span<const double> gram,
                                              std::span<const double> projected) {
  const auto n = static_cast<Eigen::Index>(projected.size());
  CHECK_EQ(gram.size(), projected.size() * projected.size());
  if (n == 0) {
    return {};
  }
  Matrix scaled = Eigen::Map<const Matrix>(gram.data(), n, n);
  const Vector scale = scaled.diagonal().cwiseSqrt();
  scaled = scale.cwiseInverse().asDiagonal() * scaled * scale.cwiseInverse().asDiagonal();
  const Vector right = Eigen::Map<const Vector>(projected.data(), n).cwiseQuotient(scale);
  const double tolerance = kTolerance * right.cwiseAbs().maxCoeff();

  Vector x = Vector::Zero(n);
  std::vector<bool> chosen(static_cast<std::size_t>(n), false);
  for (Eigen::Index round = 0; round < 3 * n; ++round) {  // each adds one; few are needed twice
    const Vector gradient = right - scaled * x;
    Eigen::Index best = -1;
    for (Eigen::Index i = 0; i < n; ++i) {
      const bool is_better = best < 0 ? gradient(i) > tolerance : gradient(i) > gradient(best);
      if (!chosen[static_cast<std::size_t>(i)] && is_better) {
        best = i;
      }
    }
    if (best < 0) {
      break;
    }
    chosen[static_cast<std::size_t>(best)] = true;
    while (step_to_bound(x, solve_among(scaled, right, chosen), chosen)) {
    }
  }
  const Vector result = x.cwiseQuotient(scale).cwiseMax(0.0);
  return {result.data(), result.data() + n};
}

}  // namespace weft::render
