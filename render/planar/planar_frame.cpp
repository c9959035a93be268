// SPDX-License-Identifier: Apache-2.0
// Renders a view of focal_plane, nearest or aperture in stages: finds the cameras, marks the source
// pixels in blocks of 8 rows, decodes them and blends each row. A row is blended in spans, each
// within one cell of the array. With several ranks (thesis 4.1.2), contribute() returns the sums of
// this rank's cameras and combine() finishes the sums of all ranks. Cost: that of blend_span() for
// every pixel.
#include "render/planar/planar_frame.h"

#include <algorithm>
#include <utility>

#include "base/parallel.h"

namespace raystage::render {
namespace {

std::array<double, 3> as_array(const Eigen::Vector3d& v) { return {v.x(), v.y(), v.z()}; }

}  // namespace

PlanarFrame::PlanarFrame(const VirtualCamera& view, const LightFieldFrame& instant,
                         const Eigen::Vector4d& plane, const ViewRegion* region, bool count_needed)
    : view_(view),
      instant_(instant),
      projection_(view, plane),
      cells_(view, *instant.rig, *instant.present),
      rows_(view, cells_, region),
      sources_(instant, projection_, count_needed),
      used_(instant.rig->cameras.size()) {}

RenderedView PlanarFrame::render() {
  if (is_eye_on_plane()) return transparent_view();
  RenderedView image = uninitialised_view(view_);
  const auto decoded = decode(image.statistics);
  blend(image, SumStage::kSampleAndFinish);
  complete(image);
  image.statistics.render_ms = milliseconds(RenderClock::now() - decoded);
  return image;
}

Contribution PlanarFrame::contribute() {
  Contribution contribution;
  contribution.planes.emplace_back(view_value_count(view_), 0.0F);
  if (is_eye_on_plane()) return contribution;
  const auto decoded = decode(contribution.statistics);
  rows_.for_each_row_block([&](int first, int end) {
    for (int y = first; y < end; ++y) {
      float* const row =
          contribution.planes[0].data() + static_cast<std::ptrdiff_t>(y) * view_.width * 4;
      for (const RayCells::Span& span : rows_.spans(y)) {
        if (!has_frame(span)) continue;
        blend_span(span, y, 1, row + std::ptrdiff_t{4} * span.begin, nullptr, nullptr,
                   SumStage::kSampleOnly);
      }
    }
  });
  contribution.statistics.render_ms = milliseconds(RenderClock::now() - decoded);
  return contribution;
}

RenderedView PlanarFrame::combine(PixelValues sums) {
  if (is_eye_on_plane()) return transparent_view();
  const auto start = RenderClock::now();
  RenderedView image = uninitialised_view(view_, std::move(sums));
  find_cameras();
  blend(image, SumStage::kFinishOnly);
  complete(image);
  image.statistics.render_ms = milliseconds(RenderClock::now() - start);
  return image;
}

PixelRun PlanarFrame::run_in_cell(const RayCells::Span& span, int y) const {
  const RayCells::Cell& cell = cells_.cells()[span.cell];
  PixelRun run;
  run.begin = span.begin;
  run.end = span.end;
  run.y = y;
  run.room_end = view_.width;  // rows are written from left to right
  run.count = cell.count;
  for (int i = 0; i < cell.count; ++i) run.share[i] = as_array(cell.share[i]);
  run.total = as_array(cell.total);
  run.slope = as_array(projection_.slope());
  run.distance = projection_.distance();
  run.at_infinity = projection_.at_infinity();
  return run;
}

RenderClock::time_point PlanarFrame::decode(RenderStatistics& statistics) {
  const auto start = RenderClock::now();
  find_cameras();
  std::vector<int> opened;
  for (const int camera : instant_.present_cameras()) {
    if (used_[camera] && instant_.is_local(camera)) opened.push_back(camera);
  }
  sources_.open(opened);
  mark_needed();
  const auto planned = RenderClock::now();
  sources_.decode(statistics);
  const auto decoded = RenderClock::now();
  statistics.plan_ms = milliseconds(planned - start);
  statistics.decode_ms = milliseconds(decoded - planned);
  return decoded;
}

void PlanarFrame::mark_needed() {
  constexpr int kRowsPerBlock = 8;
  if (sources_.are_fully_decoded()) return;
  raystage::parallel_for(0, (view_.height + kRowsPerBlock - 1) / kRowsPerBlock, [&](int block) {
    const int first = block * kRowsPerBlock;
    mark_rows(first, std::min(first + kRowsPerBlock, view_.height));
  });
}

void PlanarFrame::blend(RenderedView& image, SumStage sums) {
  const auto full_scale = static_cast<float>(instant_.cache->full_scale());
  rows_.write(image, [&](const RayCells::Span& span, int y, std::size_t at) {
    blend_span(span, y, full_scale, &image.rgba[at * 4], &image.coverage[at], &image.z[at], sums);
  });
}

}  // namespace raystage::render
