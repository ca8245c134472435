// SPDX-License-Identifier: Apache-2.0
// Source of the kernels, included once per instruction set with DKB_KERNEL set to the function attribute.
// No include guard: see kernels.cpp.
#include "dkb/solver/pack.inl"

// Huber: rho(s) = s up to the corner c^2, 2 c sqrt(s) - c^2 beyond. Returns rho; `slope` is its derivative.
DKB_KERNEL inline Pack huber(const Pack& s, const Pack& corner2, Pack& slope) {
  const Mask beyond = s > corner2;
  const Pack root = square_root(select(beyond, s, corner2)), corner = square_root(corner2);
  slope = select(beyond, corner / root, all(1.0));
  return select(beyond, 2.0 * corner * root - corner2, s);
}

// Residuals of four observations and their weights.
struct Residuals {
  Pack x, y, z;           // [m] point in the camera; (0, 0, 1) where it is not in front
  Pack inv_z, xn, yn;     // 1/z, x/z, y/z
  Pack eu, ev, ed;        // in standard deviations
  Pack inv_sigma, inv_depth_sigma;
  Pack weight_pixel, weight_depth;  // slope of the cost by half the squared residual
  Pack cost;
  Mask in_front;
};

DKB_KERNEL inline void point_in_camera(const CameraPose& c, const Pack& px, const Pack& py, const Pack& pz,
                                       Residuals& r) {
  r.x = c.rotation[0] * px + c.rotation[1] * py + c.rotation[2] * pz + c.translation[0];
  r.y = c.rotation[3] * px + c.rotation[4] * py + c.rotation[5] * pz + c.translation[1];
  r.z = c.rotation[6] * px + c.rotation[7] * py + c.rotation[8] * pz + c.translation[2];
  r.in_front = r.z > all(c.depth_in_front);
  r.x = select(r.in_front, r.x, all(0.0));
  r.y = select(r.in_front, r.y, all(0.0));
  r.z = select(r.in_front, r.z, all(1.0));
}

DKB_KERNEL inline void residuals(const CameraPose& c, const ObservationArrays& o, int i, Residuals& r) {
  r.inv_z = 1.0 / r.z;
  r.xn = r.x * r.inv_z;
  r.yn = r.y * r.inv_z;
  r.inv_sigma = load(o.inv_sigma + i);
  r.inv_depth_sigma = load(o.inv_depth_sigma + i);
  r.eu = (c.fx * r.xn + c.cx - load(o.u + i)) * r.inv_sigma;
  r.ev = (c.fy * r.yn + c.cy - load(o.v + i)) * r.inv_sigma;
  r.ed = (r.z - load(o.depth + i)) * r.inv_depth_sigma;
}

// Cost w rho(s) and the weights. With w = 1, or without depth, that is all. Otherwise pixel and depth count
// differently: their common part min(w, 1) has one kernel over both, the rest of the heavier one a kernel of its own,
// so that the cost stays the exact integral of its gradient.
DKB_KERNEL inline void weigh(const ObservationArrays& o, int i, const RobustLimits& limits, Residuals& r) {
  const Pack zero = all(0.0), one = all(1.0);
  const Pack weight = load(o.weight + i);
  const Pack s_pixel = r.eu * r.eu + r.ev * r.ev, s_depth = r.ed * r.ed, s = s_pixel + s_depth;
  const Pack corner2 = select(r.inv_depth_sigma > zero, all(limits.chi2_depth), all(limits.chi2_pixel));
  // The kernels of a part bend before the common one does.
  const bool bends = any(s > corner2) || any(select(weight > one, s_pixel, zero) > all(limits.chi2_pixel)) ||
                     any(select(weight < one, s_depth, zero) > all(kChi2OneDof95));
  if (!limits.robust || !bends) {
    r.weight_pixel = weight;
    r.weight_depth = one;
    r.cost = weight * s_pixel + s_depth;
  } else {
    const Pack common = select(weight < one, weight, one), more_pixel = weight - common, more_depth = one - common;
    Pack slope, slope_pixel, slope_depth;
    const Pack rho = huber(s, corner2, slope);
    // A kernel of its own with the whole weight where there is no depth: pixel corner, the same as the common one.
    const Pack rho_pixel = huber(s_pixel, all(limits.chi2_pixel), slope_pixel);
    const Pack rho_depth = huber(s_depth, all(kChi2OneDof95), slope_depth);
    r.weight_pixel = common * slope + more_pixel * slope_pixel;
    r.weight_depth = common * slope + more_depth * slope_depth;
    r.cost = common * rho + more_pixel * rho_pixel + more_depth * rho_depth;
  }
  r.weight_pixel = select(r.in_front, r.weight_pixel, zero);
  r.weight_depth = select(r.in_front, r.weight_depth, zero);
  const Pack behind = select(weight > zero, all(kBehindCost), zero);
  r.cost = select(r.in_front, r.cost, behind);
}

// M = J^T Omega J without its two zeros, g = J^T Omega e.
struct Normal {
  Pack a0, a1, a2;          // weights of the rows (1, 0, -xn), (0, 1, -yn), (0, 0, 1)
  Pack m02, m12, m22;       // m00 = a0, m11 = a1, m01 = 0
  Pack g0, g1, g2;
};

DKB_KERNEL inline void normal(const CameraPose& c, const Residuals& r, Normal& n) {
  const Pack fu = c.fx * r.inv_sigma * r.inv_z, fv = c.fy * r.inv_sigma * r.inv_z;
  const Pack wu = r.weight_pixel * fu, wv = r.weight_pixel * fv, wd = r.weight_depth * r.inv_depth_sigma;
  n.a0 = wu * fu;
  n.a1 = wv * fv;
  n.a2 = wd * r.inv_depth_sigma;
  n.m02 = -(n.a0 * r.xn);
  n.m12 = -(n.a1 * r.yn);
  n.m22 = n.a2 - n.m02 * r.xn - n.m12 * r.yn;
  n.g0 = wu * r.eu;
  n.g1 = wv * r.ev;
  n.g2 = wd * r.ed - r.xn * n.g0 - r.yn * n.g1;
}

// A^T M A and A^T g with A = [-I, skew(p)].
DKB_KERNEL inline void add_pose(const Residuals& r, const Normal& n, Pack* sums) {
  const Pack &x = r.x, &y = r.y, &z = r.z;
  // Rows of M skew(p).
  const Pack s00 = -(n.m02 * y), s01 = n.m02 * x - n.a0 * z, s02 = n.a0 * y;
  const Pack s10 = n.a1 * z - n.m12 * y, s11 = n.m12 * x, s12 = -(n.a1 * x);
  const Pack s20 = n.m12 * z - n.m22 * y, s21 = n.m22 * x - n.m02 * z, s22 = n.m02 * y - n.m12 * x;
  sums[0] += n.a0;
  sums[2] += n.m02;
  sums[3] -= s00;
  sums[4] -= s01;
  sums[5] -= s02;
  sums[6] += n.a1;
  sums[7] += n.m12;
  sums[8] -= s10;
  sums[9] -= s11;
  sums[10] -= s12;
  sums[11] += n.m22;
  sums[12] -= s20;
  sums[13] -= s21;
  sums[14] -= s22;
  // skew(p)^T (M skew(p)): minus the cross product of p with each column.
  sums[15] += z * s10 - y * s20;
  sums[16] += z * s11 - y * s21;
  sums[17] += z * s12 - y * s22;
  sums[18] += x * s21 - z * s01;
  sums[19] += x * s22 - z * s02;
  sums[20] += y * s02 - x * s12;
  sums[21] -= n.g0;
  sums[22] -= n.g1;
  sums[23] -= n.g2;
  sums[24] += z * n.g1 - y * n.g2;
  sums[25] += x * n.g2 - z * n.g0;
  sums[26] += y * n.g0 - x * n.g1;
}

DKB_KERNEL void pose_sums(const PoseInput& in, double* out) {
  Pack sums[kPoseSums];
  for (Pack& s : sums) s = all(0.0);
  for (int i = 0; i < in.count; i += 4) {
    Residuals r;
    Normal n;
    point_in_camera(in.camera, load(in.x + i), load(in.y + i), load(in.z + i), r);
    residuals(in.camera, in.observations, i, r);
    weigh(in.observations, i, in.limits, r);
    normal(in.camera, r, n);
    add_pose(r, n, sums);
    sums[kPoseCost] += r.cost;
  }
  for (int k = 0; k < kPoseSums; ++k) out[k] = sum(sums[k]);
}

DKB_KERNEL inline void write_chi2(const Residuals& r, double* out) {
  const Pack s = r.eu * r.eu + r.ev * r.ev + r.ed * r.ed;
  store(out, select(r.in_front, s, all(__builtin_inf())));
}

DKB_KERNEL void pose_chi2(const PoseInput& in, double* chi2) {
  for (int i = 0; i < in.count; i += 4) {
    Residuals r;
    point_in_camera(in.camera, load(in.x + i), load(in.y + i), load(in.z + i), r);
    residuals(in.camera, in.observations, i, r);
    write_chi2(r, chi2 + i);
  }
}

DKB_KERNEL inline void gather_residuals(const BaCameraInput& in, int i, Residuals& r) {
  Pack x = load(in.points + 4 * in.point[i]), y = load(in.points + 4 * in.point[i + 1]);
  Pack z = load(in.points + 4 * in.point[i + 2]), unused = load(in.points + 4 * in.point[i + 3]);
  transpose(x, y, z, unused);
  point_in_camera(in.camera, x, y, z, r);
  residuals(in.camera, in.observations, i, r);
}

DKB_KERNEL void ba_linearise(const BaCameraInput& in, bool fixed, double* point_sums, double* pair_sums, double* out) {
  Pack sums[kPoseSums];
  for (Pack& s : sums) s = all(0.0);
  const double* R = in.camera.rotation;
  int previous_pair = -1;
  for (int i = in.begin; i < in.end; i += 4) {
    Residuals r;
    Normal n;
    gather_residuals(in, i, r);
    weigh(in.observations, i, in.limits, r);
    normal(in.camera, r, n);
    sums[kPoseCost] += r.cost;

    // Rows of R^T J^T: q = R0 - xn R2, s = R1 - yn R2, R2; and N = M R.
    const Pack q0 = R[0] - r.xn * R[6], q1 = R[1] - r.xn * R[7], q2 = R[2] - r.xn * R[8];
    const Pack s0 = R[3] - r.yn * R[6], s1 = R[4] - r.yn * R[7], s2 = R[5] - r.yn * R[8];
    const Pack n00 = n.a0 * q0, n01 = n.a0 * q1, n02 = n.a0 * q2;
    const Pack n10 = n.a1 * s0, n11 = n.a1 * s1, n12 = n.a1 * s2;
    const Pack d0 = n.a2 * R[6], d1 = n.a2 * R[7], d2 = n.a2 * R[8];
    Pack p[12];
    p[0] = q0 * n00 + s0 * n10 + R[6] * d0;
    p[1] = q0 * n01 + s0 * n11 + R[6] * d1;
    p[2] = q0 * n02 + s0 * n12 + R[6] * d2;
    p[3] = q1 * n01 + s1 * n11 + R[7] * d1;
    p[4] = q1 * n02 + s1 * n12 + R[7] * d2;
    p[5] = q2 * n02 + s2 * n12 + R[8] * d2;
    p[6] = R[0] * n.g0 + R[3] * n.g1 + R[6] * n.g2;
    p[7] = R[1] * n.g0 + R[4] * n.g1 + R[7] * n.g2;
    p[8] = R[2] * n.g0 + R[5] * n.g1 + R[8] * n.g2;
    p[9] = p[10] = p[11] = all(0.0);
    for (int k = 0; k < 12; k += 4) transpose(p[k], p[k + 1], p[k + 2], p[k + 3]);
    for (int lane = 0; lane < 4; ++lane) {
      double* target = point_sums + static_cast<long>(kPointStride) * in.point[i + lane];
      for (int k = 0; k < 3; ++k) add_to(target + 4 * k, p[4 * k + lane]);
    }
    if (fixed) continue;

    add_pose(r, n, sums);
    const Pack n20 = d0 - r.xn * n00 - r.yn * n10, n21 = d1 - r.xn * n01 - r.yn * n11,
               n22 = d2 - r.xn * n02 - r.yn * n12;
    const Pack &x = r.x, &y = r.y, &z = r.z;
    Pack w[20];
    w[0] = -n00, w[1] = -n10, w[2] = -n20, w[3] = z * n10 - y * n20, w[4] = x * n20 - z * n00, w[5] = y * n00 - x * n10;
    w[6] = -n01, w[7] = -n11, w[8] = -n21, w[9] = z * n11 - y * n21, w[10] = x * n21 - z * n01,
    w[11] = y * n01 - x * n11;
    w[12] = -n02, w[13] = -n12, w[14] = -n22, w[15] = z * n12 - y * n22, w[16] = x * n22 - z * n02,
    w[17] = y * n02 - x * n12;
    w[18] = w[19] = all(0.0);
    for (int k = 0; k < 20; k += 4) transpose(w[k], w[k + 1], w[k + 2], w[k + 3]);
    for (int lane = 0; lane < 4; ++lane) {
      const int pair = in.pair[i + lane];
      double* target = pair_sums + static_cast<long>(kPairStride) * pair;
      if (pair == previous_pair) {
        for (int k = 0; k < 5; ++k) add_to(target + 4 * k, w[4 * k + lane]);
      } else {
        for (int k = 0; k < 5; ++k) store(target + 4 * k, w[4 * k + lane]);
      }
      previous_pair = pair;
    }
  }
  for (int k = 0; k < kPoseSums; ++k) out[k] = sum(sums[k]);
}

DKB_KERNEL double ba_cost(const BaCameraInput& in) {
  Pack total = all(0.0);
  for (int i = in.begin; i < in.end; i += 4) {
    Residuals r;
    gather_residuals(in, i, r);
    weigh(in.observations, i, in.limits, r);
    total += r.cost;
  }
  return sum(total);
}

DKB_KERNEL void ba_chi2(const BaCameraInput& in, double* chi2) {
  for (int i = in.begin; i < in.end; i += 4) {
    Residuals r;
    gather_residuals(in, i, r);
    write_chi2(r, chi2 + i);
  }
}

// Two columns of a 6x6 block are three packs: rows 0-3 of the first, rows 4-5 of the first with 0-1 of the second, rows
// 2-5 of the second. A column kept as 8 numbers y0 ... y5 y0 y1 gives the matching packs at offsets 0, 4 and 2.
struct Column {
  Pack head, wrap, tail;
};
DKB_KERNEL inline Column column(const double* y) { return {load(y), load(y + 4), load(y + 2)}; }

DKB_KERNEL void schur(const SchurInput& in, double* blocks, double* gradient, double* factors) {
  constexpr int kMaxKept = 64;  // pairs of one point whose Y is kept on the stack at a time
  double kept[24 * kMaxKept];
  for (int point = 0; point < in.points; ++point) {
    const double* v = in.point_sums + static_cast<long>(kPointStride) * point;
    double* f = factors + static_cast<long>(kPointStride) * point;
    // The same damping in all directions: a point seen along one ray only moves across it, never along it.
    const double damp = in.damping * (v[0] + v[3] + v[5]);
    const double p0 = v[0] + damp;
    f[0] = 0;
    if (!(damp > 1e-300)) continue;
    const double l00 = __builtin_sqrt(p0), i00 = 1.0 / l00, l10 = v[1] * i00, l20 = v[2] * i00;
    const double p1 = v[3] + damp - l10 * l10;
    if (!(p1 > 0)) continue;
    const double i11 = 1.0 / __builtin_sqrt(p1), l21 = (v[4] - l20 * l10) * i11;
    const double p2 = v[5] + damp - l20 * l20 - l21 * l21;
    if (!(p2 > 0)) continue;
    const double i22 = 1.0 / __builtin_sqrt(p2);
    const double g0 = v[6] * i00, g1 = (v[7] - l10 * g0) * i11, g2 = (v[8] - l20 * g0 - l21 * g1) * i22;
    f[0] = i00, f[1] = l10, f[2] = l20, f[3] = i11, f[4] = l21, f[5] = i22;
    f[6] = g0, f[7] = g1, f[8] = g2;

    const int first = in.pair_first[point], count = in.pair_first[point + 1] - first;
    const int* block_row = in.block + in.block_first[point];
    // Y = W L^-T; S -= Y Y^T; gradient -= Y L^-1 g.
    for (int chunk = 0; chunk < count; chunk += kMaxKept) {
      const int chunk_end = count < chunk + kMaxKept ? count : chunk + kMaxKept;
      for (int b = chunk; b < chunk_end; ++b) {
        const double* w = in.pair_sums + static_cast<long>(kPairStride) * (first + b);
        double* y = kept + 24 * (b - chunk);
        double* g = gradient + 6 * in.pair_camera[first + b];
        for (int k = 0; k < 6; ++k) {
          const double y0 = w[k] * i00, y1 = (w[6 + k] - l10 * y0) * i11;
          const double y2 = (w[12 + k] - l20 * y0 - l21 * y1) * i22;
          y[k] = y0, y[8 + k] = y1, y[16 + k] = y2;
          g[k] -= y0 * g0 + y1 * g1 + y2 * g2;
        }
        for (int c = 0; c < 24; c += 8) y[c + 6] = y[c], y[c + 7] = y[c + 1];
      }
      // Blocks whose second camera is in this chunk; the first may be of an earlier chunk and is made again.
      const int* row = block_row;
      for (int a = 0; a < chunk_end; row += count - a, ++a) {
        double made[24];
        if (a < chunk) {
          const double* w = in.pair_sums + static_cast<long>(kPairStride) * (first + a);
          for (int k = 0; k < 6; ++k) {
            made[k] = w[k] * i00;
            made[8 + k] = (w[6 + k] - l10 * made[k]) * i11;
            made[16 + k] = (w[12 + k] - l20 * made[k] - l21 * made[8 + k]) * i22;
          }
        }
        const double* ya = a < chunk ? made : kept + 24 * (a - chunk);
        Pack factor[27];
        for (int c = 0; c < 3; ++c) {
          for (int k = 0; k < 3; ++k) {
            const double even = ya[8 * c + 2 * k], odd = ya[8 * c + 2 * k + 1];
            factor[9 * c + 3 * k] = all(even);
            factor[9 * c + 3 * k + 1] = make(even, even, odd, odd);
            factor[9 * c + 3 * k + 2] = all(odd);
          }
        }
        for (int b = a < chunk ? chunk : a; b < chunk_end; ++b) {
          const double* yb = kept + 24 * (b - chunk);
          const Column c0 = column(yb), c1 = column(yb + 8), c2 = column(yb + 16);
          double* s = blocks + static_cast<long>(kBlockSize) * row[b - a];
          for (int k = 0; k < 3; ++k) {
            const Pack* m = factor + 3 * k;
            double* target = s + 12 * k;
            store(target, load(target) - (m[0] * c0.head + m[9] * c1.head + m[18] * c2.head));
            store(target + 4, load(target + 4) - (m[1] * c0.wrap + m[10] * c1.wrap + m[19] * c2.wrap));
            store(target + 8, load(target + 8) - (m[2] * c0.tail + m[11] * c1.tail + m[20] * c2.tail));
          }
        }
      }
    }
  }
}

DKB_KERNEL void subtract_abt(double* c, const double* a, const double* b) {
  Pack s[9];
  for (int k = 0; k < 9; ++k) s[k] = load(c + 4 * k);
  for (int m = 0; m < 6; ++m) {
    const double* y = a + 6 * m;
    const double* f = b + 6 * m;
    const Pack head = load(y), tail = load(y + 2), wrap = straddle(tail, head);
    for (int k = 0; k < 3; ++k) {
      const double even = f[2 * k], odd = f[2 * k + 1];
      s[3 * k] -= all(even) * head;
      s[3 * k + 1] -= make(even, even, odd, odd) * wrap;
      s[3 * k + 2] -= all(odd) * tail;
    }
  }
  for (int k = 0; k < 9; ++k) store(c + 4 * k, s[k]);
}

constexpr SolverKernels kTable{pose_sums, pose_chi2, ba_linearise, ba_cost, ba_chi2, schur, subtract_abt};
