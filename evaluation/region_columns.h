// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>

#include "evaluation/region_errors.h"

namespace raystage::evaluation {

/// A number of RegionErrors, as reports of several settings show it.
struct RegionColumn {
  const char* name;     ///< in CSV and JSON
  const char* heading;  ///< of a table, with the unit
  int decimals;
  double scale;  ///< factor of the number in a table: 100 for shares in percent
  bool larger_is_better;
  double (*of)(const RegionErrors&);
};

inline constexpr std::array<RegionColumn, 9> kRegionColumns{{
    {"edge_psnr_db", "edges dB", 2, 1, true,
     [](const RegionErrors& errors) { return errors.edge_band.psnr_db; }},
    {"edge_ms_ssim", "edges MS-SSIM", 4, 1, true,
     [](const RegionErrors& errors) { return errors.edge_band.ms_ssim; }},
    {"thin_psnr_db", "thin dB", 2, 1, true,
     [](const RegionErrors& errors) { return errors.thin.psnr_db; }},
    {"thin_ms_ssim", "thin MS-SSIM", 4, 1, true,
     [](const RegionErrors& errors) { return errors.thin.ms_ssim; }},
    {"bad_depths_half_px", "bad 0.5 px %", 2, 100, false,
     [](const RegionErrors& errors) { return errors.bad_depths_half_px; }},
    {"bad_depths_1_px", "bad 1 px %", 2, 100, false,
     [](const RegionErrors& errors) { return errors.bad_depths_1_px; }},
    {"plane_rms_px", "planes px RMS", 3, 1, false,
     [](const RegionErrors& errors) { return errors.plane_rms_px; }},
    {"edge_alpha", "alpha error", 3, 1, false,
     [](const RegionErrors& errors) { return errors.edge_alpha; }},
    {"edge_alpha_gradient", "alpha gradient", 3, 1, false,
     [](const RegionErrors& errors) { return errors.edge_alpha_gradient; }},
}};

}  // namespace raystage::evaluation
