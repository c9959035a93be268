// SPDX-License-Identifier: Apache-2.0
#include "rig/line_time_check.h"

#include <fmt/format.h>

#include "rig/row_times.h"

namespace raystage::rig {

std::optional<Error> line_time_error(const Rig& rig, std::span<const double> periods_ns, double fps,
                                     const std::string& where) {
  constexpr double kTolerance = 1.01;  // of rounded line times and measured rates
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Rig::Camera& camera = rig.cameras[i];
    const double own = i < periods_ns.size() ? periods_ns[i] : 0;
    const double frame_ms = own > 0 ? 1e-6 * own : fps > 0 ? 1e3 / fps : 0;
    const double read_out = read_out_ms(camera.line_time_us, camera.model.height());
    if (frame_ms == 0 || read_out <= kTolerance * frame_ms) continue;
    return Error::bad_input(
        fmt::format("camera {}: with the line time of {:.6g} us, {} rows take {:.6g} ms, longer "
                    "than a frame time of {:.4g} ms",
                    camera.id, camera.line_time_us, camera.model.height(), read_out, frame_ms),
        where, "Correct line_time_us: microseconds from a row to the row below");
  }
  return std::nullopt;
}

}  // namespace raystage::rig
