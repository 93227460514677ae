#include "render/baselines/low_rank_bcsdf.h"

#include <algorithm>
#include <cmath>

#include <Eigen/Dense>
#include <glm/geometric.hpp>
#include <tbb/parallel_for.h>

#include "core/check.h"
#include "render/sphere_sampling.h"

namespace weft::render {
namespace {

using Matrix = Eigen::MatrixXd;

glm::vec3 fibre_direction(double theta, double phi) {
  return {std::sin(theta), std::cos(theta) * std::cos(phi), std::cos(theta) * std::sin(phi)};
}

// cos(2 pi k / count), k = 0 ... count - 1.
std::vector<double> cosines(int count) {
  std::vector<double> result;
  for (int k = 0; k < count; ++k) {
    result.push_back(std::cos(2 * kPi * k / count));
  }
  return result;
}

int row_of(const LowRankSettings& settings, float theta) {
  const double share = static_cast<double>(theta) / kPi + 0.5;
  return std::clamp(static_cast<int>(std::floor(share * settings.thetas)), 0, settings.thetas - 1);
}

double theta_of(const LowRankSettings& settings, int row) {
  return kPi * ((row + 0.5) / settings.thetas - 0.5);
}

double scale(const LowRankSettings& settings, int light, int eye) {
  const double c_i = std::cos(theta_of(settings, light));
  return settings.weighted ? c_i * std::sqrt(c_i * std::cos(theta_of(settings, eye))) : 1.0;
}

// Cosine sums of S over azimuth, in which it is even: one matrix per frequency.
std::vector<Matrix> blocks(const LowRankSettings& settings, const shading::FibreBcsdf& bcsdf,
                           int channel) {
  const int n = settings.thetas;
  const int phis = settings.phis;
  const std::vector<double> wave = cosines(phis);
  std::vector<Matrix> result(static_cast<std::size_t>(phis) / 2 + 1, Matrix::Zero(n, n));
  for (int light = 0; light < n; ++light) {
    for (int eye = 0; eye < n; ++eye) {
      const glm::vec3 omega_o = fibre_direction(theta_of(settings, eye), 0);
      for (int p = 0; p <= phis / 2; ++p) {
        const glm::vec3 omega_i = fibre_direction(theta_of(settings, light), 2 * kPi * p / phis);
        const double both = p == 0 || p == phis / 2 ? 1 : 2;
        const double s = both * scale(settings, light, eye) *
                         static_cast<double>(bcsdf.evaluate(omega_i, omega_o)[channel]);
        for (int m = 0; s > 0 && m <= phis / 2; ++m) {
          result[static_cast<std::size_t>(m)](light, eye) +=
              s * wave[static_cast<std::size_t>(m * p % phis)];
        }
      }
    }
  }
  return result;
}

// One singular value of a block, which the whole matrix has `times` times.
struct Term {
  double value;
  int frequency;
  int index;
  int times;
};

// The terms of the whole matrix's decomposition up to the rank, summed again block by block; and
// their share of the squared norm.
std::vector<Matrix> truncated(const std::vector<Matrix>& whole, std::uint32_t most_terms,
                              double& kept_share) {
  std::vector<Eigen::BDCSVD<Matrix>> parts;
  std::vector<Term> terms;
  double norm = 0;
  for (const Matrix& block : whole) {
    const int m = static_cast<int>(parts.size());
    const int times = m == 0 || m + 1 == static_cast<int>(whole.size()) ? 1 : 2;
    parts.emplace_back(block, Eigen::ComputeThinU | Eigen::ComputeThinV);
    for (int k = 0; k < block.rows(); ++k) {
      const double value = parts.back().singularValues()(k);
      terms.push_back({value, m, k, times});
      norm += times * value * value;
    }
  }
  std::stable_sort(terms.begin(), terms.end(),
                   [](const Term& a, const Term& b) { return a.value > b.value; });
  std::vector<Matrix> kept;
  for (const Matrix& block : whole) {
    kept.push_back(Matrix::Zero(block.rows(), block.cols()));
  }
  double held = 0;
  std::uint32_t rank = 0;
  for (const Term& term : terms) {
    rank += static_cast<std::uint32_t>(term.times);
    if (rank > most_terms) {
      break;
    }
    held += term.times * term.value * term.value;
    const auto& part = parts[static_cast<std::size_t>(term.frequency)];
    kept[static_cast<std::size_t>(term.frequency)] +=
        term.value * part.matrixU().col(term.index) * part.matrixV().col(term.index).transpose();
  }
  kept_share = norm > 0 ? held / norm : 1;
  return kept;
}

}  // namespace

float nearest_theta(const LowRankSettings& settings, float theta) {
  return static_cast<float>(theta_of(settings, row_of(settings, theta)));
}

LowRankBcsdf::LowRankBcsdf(const shading::FibreBcsdf& bcsdf, const LowRankSettings& settings)
    : settings_(settings) {
  CHECK(settings.thetas > 1 && settings.phis > 0 && settings.phis % 2 == 0);
  const std::size_t n = static_cast<std::size_t>(settings.thetas);
  kept_.resize(3 * (static_cast<std::size_t>(settings.phis) / 2 + 1) * n * n);
  tbb::parallel_for(0, 3, [&](int channel) { decompose(bcsdf, channel); });
}

void LowRankBcsdf::decompose(const shading::FibreBcsdf& bcsdf, int channel) {
  const int n = settings_.thetas;
  std::vector<Matrix> kept = blocks(settings_, bcsdf, channel);
  kept_share_[channel] = 1;
  if (settings_.rank > 0) {
    kept = truncated(kept, settings_.rank, kept_share_[channel]);
  }
  std::size_t out = static_cast<std::size_t>(channel) * kept_.size() / 3;
  for (const Matrix& block : kept) {
    for (int light = 0; light < n; ++light) {
      for (int eye = 0; eye < n; ++eye) {
        kept_[out++] = static_cast<float>(block(light, eye) / scale(settings_, light, eye));
      }
    }
  }
}

std::vector<LowRankBcsdf::Entry> LowRankBcsdf::column(float theta_o) const {
  const int n = settings_.thetas;
  const int phis = settings_.phis;
  const int frequencies = phis / 2 + 1;
  const int eye = row_of(settings_, theta_o);
  const std::vector<double> waves = cosines(phis);
  std::vector<Entry> entries;
  entries.reserve(static_cast<std::size_t>(n) * static_cast<std::size_t>(phis));
  for (int light = 0; light < n; ++light) {
    const double theta = theta_of(settings_, light);
    const double solid_angle =
        2 * kPi / phis * (std::sin(theta + kPi / n / 2) - std::sin(theta - kPi / n / 2));
    for (int p = 0; p < phis; ++p) {
      glm::dvec3 s(0);
      for (int m = 0; m < frequencies; ++m) {
        const double both = m == 0 || m == phis / 2 ? 1 : 2;
        const double wave = both / phis * waves[static_cast<std::size_t>(m * p % phis)];
        for (int channel = 0; channel < 3; ++channel) {
          const std::ptrdiff_t at =
              ((static_cast<std::ptrdiff_t>(channel) * frequencies + m) * n + light) * n + eye;
          s[channel] += wave * static_cast<double>(kept_[static_cast<std::size_t>(at)]);
        }
      }
      entries.push_back({fibre_direction(theta, 2 * kPi * p / phis),
                         glm::vec3(s * (std::cos(theta) * solid_angle))});
    }
  }
  return entries;
}

}  // namespace weft::render
