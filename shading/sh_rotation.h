// Shared text (C++20 and GLSL): rotation of spherical harmonics up to order 5.
#ifndef WEFT_SHADING_SH_ROTATION_H
#define WEFT_SHADING_SH_ROTATION_H

#include "shading/dialect.h"
#include "shading/spherical_harmonics.h"

SHARED_BEGIN

// D of the quarter turn (x, y, z) -> (x, z, -y), which takes the z axis to the y axis: 76 of its
// 286 entries are not zero (Pinchon and Hoggan 2007).
SHARED ShVector sh_turn_z_to_y(ShVector v) {
  ShVector r;
  r.c[0] = v.c[0];
  r.c[1] = v.c[2];
  r.c[2] = -v.c[1];
  r.c[3] = v.c[3];
  r.c[4] = v.c[7];
  r.c[5] = -v.c[5];
  r.c[6] = -0.5f * v.c[6] - 0.866025404f * v.c[8];
  r.c[7] = -v.c[4];
  r.c[8] = -0.866025404f * v.c[6] + 0.5f * v.c[8];
  r.c[9] = -0.790569415f * v.c[12] + 0.612372436f * v.c[14];
  r.c[10] = -v.c[10];
  r.c[11] = -0.612372436f * v.c[12] - 0.790569415f * v.c[14];
  r.c[12] = 0.790569415f * v.c[9] + 0.612372436f * v.c[11];
  r.c[13] = -0.25f * v.c[13] - 0.968245837f * v.c[15];
  r.c[14] = -0.612372436f * v.c[9] + 0.790569415f * v.c[11];
  r.c[15] = -0.968245837f * v.c[13] + 0.25f * v.c[15];
  r.c[16] = -0.935414347f * v.c[21] + 0.353553391f * v.c[23];
  r.c[17] = -0.75f * v.c[17] + 0.661437828f * v.c[19];
  r.c[18] = -0.353553391f * v.c[21] - 0.935414347f * v.c[23];
  r.c[19] = 0.661437828f * v.c[17] + 0.75f * v.c[19];
  r.c[20] = 0.375f * v.c[20] + 0.559016994f * v.c[22] + 0.739509973f * v.c[24];
  r.c[21] = 0.935414347f * v.c[16] + 0.353553391f * v.c[18];
  r.c[22] = 0.559016994f * v.c[20] + 0.5f * v.c[22] - 0.661437828f * v.c[24];
  r.c[23] = -0.353553391f * v.c[16] + 0.935414347f * v.c[18];
  r.c[24] = 0.739509973f * v.c[20] - 0.661437828f * v.c[22] + 0.125f * v.c[24];
  r.c[25] = 0.70156076f * v.c[30] - 0.684653197f * v.c[32] + 0.197642354f * v.c[34];
  r.c[26] = -0.5f * v.c[26] + 0.866025404f * v.c[28];
  r.c[27] = 0.522912517f * v.c[30] + 0.306186218f * v.c[32] - 0.795495129f * v.c[34];
  r.c[28] = 0.866025404f * v.c[26] + 0.5f * v.c[28];
  r.c[29] = 0.484122918f * v.c[30] + 0.661437828f * v.c[32] + 0.572821962f * v.c[34];
  r.c[30] = -0.70156076f * v.c[25] - 0.522912517f * v.c[27] - 0.484122918f * v.c[29];
  r.c[31] = 0.125f * v.c[31] + 0.405046294f * v.c[33] + 0.905711047f * v.c[35];
  r.c[32] = 0.684653197f * v.c[25] - 0.306186218f * v.c[27] - 0.661437828f * v.c[29];
  r.c[33] = 0.405046294f * v.c[31] + 0.8125f * v.c[33] - 0.419262746f * v.c[35];
  r.c[34] = -0.197642354f * v.c[25] + 0.795495129f * v.c[27] - 0.572821962f * v.c[29];
  r.c[35] = 0.905711047f * v.c[31] - 0.419262746f * v.c[33] + 0.0625f * v.c[35];
  return r;
}

// Its inverse.
SHARED ShVector sh_turn_y_to_z(ShVector v) {
  ShVector r;
  r.c[0] = v.c[0];
  r.c[1] = -v.c[2];
  r.c[2] = v.c[1];
  r.c[3] = v.c[3];
  r.c[4] = -v.c[7];
  r.c[5] = -v.c[5];
  r.c[6] = -0.5f * v.c[6] - 0.866025404f * v.c[8];
  r.c[7] = v.c[4];
  r.c[8] = -0.866025404f * v.c[6] + 0.5f * v.c[8];
  r.c[9] = 0.790569415f * v.c[12] - 0.612372436f * v.c[14];
  r.c[10] = -v.c[10];
  r.c[11] = 0.612372436f * v.c[12] + 0.790569415f * v.c[14];
  r.c[12] = -0.790569415f * v.c[9] - 0.612372436f * v.c[11];
  r.c[13] = -0.25f * v.c[13] - 0.968245837f * v.c[15];
  r.c[14] = 0.612372436f * v.c[9] - 0.790569415f * v.c[11];
  r.c[15] = -0.968245837f * v.c[13] + 0.25f * v.c[15];
  r.c[16] = 0.935414347f * v.c[21] - 0.353553391f * v.c[23];
  r.c[17] = -0.75f * v.c[17] + 0.661437828f * v.c[19];
  r.c[18] = 0.353553391f * v.c[21] + 0.935414347f * v.c[23];
  r.c[19] = 0.661437828f * v.c[17] + 0.75f * v.c[19];
  r.c[20] = 0.375f * v.c[20] + 0.559016994f * v.c[22] + 0.739509973f * v.c[24];
  r.c[21] = -0.935414347f * v.c[16] - 0.353553391f * v.c[18];
  r.c[22] = 0.559016994f * v.c[20] + 0.5f * v.c[22] - 0.661437828f * v.c[24];
  r.c[23] = 0.353553391f * v.c[16] - 0.935414347f * v.c[18];
  r.c[24] = 0.739509973f * v.c[20] - 0.661437828f * v.c[22] + 0.125f * v.c[24];
  r.c[25] = -0.70156076f * v.c[30] + 0.684653197f * v.c[32] - 0.197642354f * v.c[34];
  r.c[26] = -0.5f * v.c[26] + 0.866025404f * v.c[28];
  r.c[27] = -0.522912517f * v.c[30] - 0.306186218f * v.c[32] + 0.795495129f * v.c[34];
  r.c[28] = 0.866025404f * v.c[26] + 0.5f * v.c[28];
  r.c[29] = -0.484122918f * v.c[30] - 0.661437828f * v.c[32] - 0.572821962f * v.c[34];
  r.c[30] = 0.70156076f * v.c[25] + 0.522912517f * v.c[27] + 0.484122918f * v.c[29];
  r.c[31] = 0.125f * v.c[31] + 0.405046294f * v.c[33] + 0.905711047f * v.c[35];
  r.c[32] = -0.684653197f * v.c[25] + 0.306186218f * v.c[27] + 0.661437828f * v.c[29];
  r.c[33] = 0.405046294f * v.c[31] + 0.8125f * v.c[33] - 0.419262746f * v.c[35];
  r.c[34] = 0.197642354f * v.c[25] - 0.795495129f * v.c[27] + 0.572821962f * v.c[29];
  r.c[35] = 0.905711047f * v.c[31] - 0.419262746f * v.c[33] + 0.0625f * v.c[35];
  return r;
}

// D of the rotation about z by the angle of the given cosine and sine: for every m > 0,
// (m, -m) turns by m times the angle. Without loops, as the quarter turns: indices that compilers
// know keep the vector in registers, which makes it 40 times faster on lavapipe.
SHARED ShVector sh_turn_about_z(ShVector v, float cosine, float sine) {
  ShVector r = v;
  float c1 = cosine;
  float s1 = sine;
  float c2 = c1 * cosine - s1 * sine;
  float s2 = s1 * cosine + c1 * sine;
  float c3 = c2 * cosine - s2 * sine;
  float s3 = s2 * cosine + c2 * sine;
  float c4 = c3 * cosine - s3 * sine;
  float s4 = s3 * cosine + c3 * sine;
  float c5 = c4 * cosine - s4 * sine;
  float s5 = s4 * cosine + c4 * sine;
  r.c[3] = c1 * v.c[3] - s1 * v.c[1];
  r.c[1] = s1 * v.c[3] + c1 * v.c[1];
  r.c[7] = c1 * v.c[7] - s1 * v.c[5];
  r.c[5] = s1 * v.c[7] + c1 * v.c[5];
  r.c[13] = c1 * v.c[13] - s1 * v.c[11];
  r.c[11] = s1 * v.c[13] + c1 * v.c[11];
  r.c[21] = c1 * v.c[21] - s1 * v.c[19];
  r.c[19] = s1 * v.c[21] + c1 * v.c[19];
  r.c[31] = c1 * v.c[31] - s1 * v.c[29];
  r.c[29] = s1 * v.c[31] + c1 * v.c[29];
  r.c[8] = c2 * v.c[8] - s2 * v.c[4];
  r.c[4] = s2 * v.c[8] + c2 * v.c[4];
  r.c[14] = c2 * v.c[14] - s2 * v.c[10];
  r.c[10] = s2 * v.c[14] + c2 * v.c[10];
  r.c[22] = c2 * v.c[22] - s2 * v.c[18];
  r.c[18] = s2 * v.c[22] + c2 * v.c[18];
  r.c[32] = c2 * v.c[32] - s2 * v.c[28];
  r.c[28] = s2 * v.c[32] + c2 * v.c[28];
  r.c[15] = c3 * v.c[15] - s3 * v.c[9];
  r.c[9] = s3 * v.c[15] + c3 * v.c[9];
  r.c[23] = c3 * v.c[23] - s3 * v.c[17];
  r.c[17] = s3 * v.c[23] + c3 * v.c[17];
  r.c[33] = c3 * v.c[33] - s3 * v.c[27];
  r.c[27] = s3 * v.c[33] + c3 * v.c[27];
  r.c[24] = c4 * v.c[24] - s4 * v.c[16];
  r.c[16] = s4 * v.c[24] + c4 * v.c[16];
  r.c[34] = c4 * v.c[34] - s4 * v.c[26];
  r.c[26] = s4 * v.c[34] + c4 * v.c[26];
  r.c[35] = c5 * v.c[35] - s5 * v.c[25];
  r.c[25] = s5 * v.c[35] + c5 * v.c[25];
  return r;
}

// R = Rz(alpha) Ry(beta) Rz(gamma), as cosines and sines.
struct ShRotation {
  vec2 alpha;
  vec2 beta;
  vec2 gamma;
};

// REQUIRES: `r` is orthonormal with determinant 1; r[column][row].
SHARED ShRotation sh_rotation(mat3 r) {
  ShRotation e;
  float cos_beta = clamp(r[2][2], -1.0f, 1.0f);
  float sin_beta = sqrt(r[2][0] * r[2][0] + r[2][1] * r[2][1]);
  float norm = inversesqrt(cos_beta * cos_beta + sin_beta * sin_beta);
  e.beta = vec2(cos_beta * norm, sin_beta * norm);
  if (sin_beta > 1e-6f) {
    // R z = (cos alpha sin beta, sin alpha sin beta, cos beta); the last row is (-sin beta cos
    // gamma, sin beta sin gamma, cos beta).
    e.alpha = vec2(r[2][0], r[2][1]) / sin_beta;
    vec2 g = vec2(-r[0][2], r[1][2]);
    float length2 = dot(g, g);
    e.gamma = length2 > 0.0f ? g * inversesqrt(length2) : vec2(1.0f, 0.0f);
  } else {
    e.alpha = normalize(vec2(r[1][1], -r[1][0]));
    e.gamma = vec2(1.0f, 0.0f);
  }
  return e;
}

// D(R) v, where Y(R omega) = D(R) Y(omega): if v holds f, the result holds f(R^-1 omega). Uses
// Ry(beta) = C Rz(beta) C^-1 for the quarter turn C that takes z to y.
SHARED ShVector sh_rotate(ShRotation r, ShVector v) {
  ShVector a = sh_turn_y_to_z(sh_turn_about_z(v, r.gamma.x, r.gamma.y));
  ShVector b = sh_turn_z_to_y(sh_turn_about_z(a, r.beta.x, r.beta.y));
  return sh_turn_about_z(b, r.alpha.x, r.alpha.y);
}

SHARED_END

#endif
