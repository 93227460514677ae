#include "transport/pca.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include <Eigen/Dense>

#include "core/check.h"
#include "core/random.h"

namespace weft::transport {

namespace {

using Images = Eigen::Matrix<float, Eigen::Dynamic, Eigen::Dynamic, Eigen::RowMajor>;
using Columns = Eigen::MatrixXf;

// The subspace is wider than what is asked for by this, so that the last components converge as
// fast as the spectrum beyond them falls. After three iterations as many signs of held-out images
// are right as after eight.
constexpr Eigen::Index kOversampling = 16;
constexpr int kIterations = 3;

// Subtracts and returns the mean image.
std::vector<float> centre(std::vector<float>& images, std::size_t pixels) {
  const std::size_t count = images.size() / pixels;
  std::vector<double> sum(pixels);
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t p = 0; p < pixels; ++p) {
      sum[p] += static_cast<double>(images[i * pixels + p]);
    }
  }
  std::vector<float> mean(pixels);
  for (std::size_t p = 0; p < pixels; ++p) {
    mean[p] = static_cast<float>(sum[p] / std::max(1.0, static_cast<double>(count)));
  }
  for (std::size_t i = 0; i < count; ++i) {
    for (std::size_t p = 0; p < pixels; ++p) {
      images[i * pixels + p] -= mean[p];
    }
  }
  return mean;
}

Columns random_start(Eigen::Index rows, Eigen::Index columns, std::uint64_t seed) {
  Columns start(rows, columns);
  for (Eigen::Index c = 0; c < columns; ++c) {
    core::Random random(seed, static_cast<std::uint32_t>(c));
    for (Eigen::Index r = 0; r < rows; ++r) {
      start(r, c) = random.uniform() - 0.5f;
    }
  }
  return start;
}

Columns orthonormal(const Columns& columns) {
  const Eigen::HouseholderQR<Columns> factors(columns);
  return factors.householderQ() * Columns::Identity(columns.rows(), columns.cols());
}

// Components have no sign of their own: the entry of the largest size is made positive.
void fix_sign(Eigen::Ref<Eigen::VectorXf> component) {
  Eigen::Index largest = 0;
  component.cwiseAbs().maxCoeff(&largest);
  if (component[largest] < 0) {
    component = -component;
  }
}

}  // namespace

// Halko, Martinsson, Tropp 2011, algorithm 4.4 (randomised subspace iteration): with X the centred
// images, Q <- orthonormal(X^T (X Q)) turns towards the leading eigenvectors of X^T X, which is
// never formed; those of the small Q^T X^T X Q then separate them.
DistanceBasis principal_components(std::vector<float>& images, std::uint32_t pixels,
                                   std::uint32_t components, std::uint64_t seed,
                                   const Checkpoint& checkpoint) {
  CHECK_GT(pixels, 0U);
  CHECK_EQ(images.size() % pixels, 0U);
  DistanceBasis basis;
  basis.pixels = pixels;
  basis.mean = centre(images, pixels);
  basis.components.assign(std::size_t{components} * pixels, 0.0f);
  basis.variance.assign(components, 0.0f);
  const auto count = static_cast<Eigen::Index>(images.size() / pixels);
  const auto width = static_cast<Eigen::Index>(pixels);
  const Eigen::Index subspace =
      std::min({static_cast<Eigen::Index>(components) + kOversampling, count, width});
  if (count < 2) {
    return basis;
  }
  const Eigen::Map<const Images> x(images.data(), count, width);
  Columns q = orthonormal(random_start(width, subspace, seed));
  Columns scores;
  for (int i = 0; i < kIterations; ++i) {
    pass(checkpoint);
    scores.noalias() = x * q;
    pass(checkpoint);
    q.noalias() = x.transpose() * scores;
    q = orthonormal(q);
  }
  pass(checkpoint);
  scores.noalias() = x * q;
  const Eigen::MatrixXd small = scores.cast<double>().transpose() * scores.cast<double>();
  const Eigen::SelfAdjointEigenSolver<Eigen::MatrixXd> solver(small);
  const Eigen::Index kept = std::min(subspace, static_cast<Eigen::Index>(components));
  for (Eigen::Index i = 0; i < kept; ++i) {
    const Eigen::Index falling = subspace - 1 - i;
    const double variance = solver.eigenvalues()[falling] / static_cast<double>(count - 1);
    if (!(variance > 1e-12 * solver.eigenvalues()[subspace - 1])) {
      break;  // the sample spans no more
    }
    Eigen::Map<Eigen::VectorXf> component(&basis.components[static_cast<std::size_t>(i) * pixels],
                                          width);
    component = q * solver.eigenvectors().col(falling).cast<float>();
    fix_sign(component);
    basis.variance[static_cast<std::size_t>(i)] = static_cast<float>(variance);
  }
  return basis;
}

std::vector<float> project(const DistanceBasis& basis, std::span<const float> distances) {
  CHECK_EQ(distances.size(), std::size_t{basis.pixels});
  Eigen::VectorXf centred(static_cast<Eigen::Index>(distances.size()));
  for (std::size_t p = 0; p < distances.size(); ++p) {
    centred[static_cast<Eigen::Index>(p)] =
        std::clamp(distances[p], -kDistanceClamp, kDistanceClamp) - basis.mean[p];
  }
  const auto count = static_cast<Eigen::Index>(basis.variance.size());
  std::vector<float> coefficients(basis.variance.size());
  Eigen::Map<Eigen::VectorXf>(coefficients.data(), count).noalias() =
      Eigen::Map<const Images>(basis.components.data(), count, centred.size()) * centred;
  return coefficients;
}

std::vector<float> reconstruct(const DistanceBasis& basis, std::span<const float> coefficients) {
  CHECK_EQ(coefficients.size(), basis.variance.size());
  const auto count = static_cast<Eigen::Index>(coefficients.size());
  std::vector<float> image = basis.mean;
  const auto width = static_cast<Eigen::Index>(image.size());
  Eigen::Map<Eigen::VectorXf>(image.data(), width).noalias() +=
      Eigen::Map<const Images>(basis.components.data(), count, width).transpose() *
      Eigen::Map<const Eigen::VectorXf>(coefficients.data(), count);
  return image;
}

}  // namespace weft::transport
