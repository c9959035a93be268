// SPDX-License-Identifier: Apache-2.0
// Stores the camera depths of light field frames as FOLDER/depth/SET/INSTANT.zst
// (docs/formats/depth.md). SET and INSTANT are XXH3 hashes of all inputs, so that a file is found
// exactly if its inputs are equal. Damaged files are estimated again. Sets are removed by their
// last use unless they are pinned. Cost: reading the encoded frames of all cameras for the key; the
// estimation (camera_depths.cpp) if there is no file.
#include "render/depth/depth_store.h"

#include <fcntl.h>
#include <fmt/format.h>
#include <sys/stat.h>
#include <xxhash.h>

#include <algorithm>
#include <array>
#include <bit>
#include <fstream>
#include <functional>
#include <map>
#include <span>
#include <utility>
#include <vector>

#include "base/atomic_file.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/little_endian.h"
#include "base/mapped_file.h"
#include "render/depth/depth_file.h"
#include "rig/camera_stations.h"
#include "store/bag_payload.h"

namespace raystage::render {
namespace {

namespace fs = std::filesystem;

constexpr std::uint32_t kAlgorithm = 5;  ///< raise it if equal inputs give different depths
constexpr std::size_t kDigits = 16;

/// Sets the time of use of a set or file; failure is ignored. Everyone who may write to the folder
/// may set UTIME_NOW; only its owner may set an explicit time.
void mark_used(const fs::path& used) {
  constexpr timespec kNow{0, UTIME_NOW};
  const std::array times{kNow, kNow};
  utimensat(AT_FDCWD, used.c_str(), times.data(), 0);
}

bool read_maps(const ContainedPath& stored, std::uint64_t fingerprint, CameraDepths& depths) {
  const fs::path file = stored.path();
  std::error_code error;
  if (!fs::exists(file, error)) return false;
  try {
    const MappedFile mapped(stored);
    if (!mapped.can_read(mapped.bytes())) return false;
    depths.maps = read_mapped(
        [&] {
          return decode_depth_maps(mapped.bytes(), fingerprint, depths.pinholes, file.string());
        },
        mapped);
  } catch (const Error&) {
    return false;  // estimated again and overwritten
  }
  mark_used(file.parent_path());
  return true;
}

void write_maps(const fs::path& file, std::span<const InverseDepthMap> maps,
                std::uint64_t fingerprint) {
  TemporaryFile temporary(file);
  std::ofstream out(temporary.path(), std::ios::binary);
  encode_depth_maps(maps, fingerprint, [&](std::span<const std::byte> block) {
    out.write(reinterpret_cast<const char*>(block.data()),  // NOLINT: bytes are bytes
              static_cast<std::streamsize>(block.size()));
  });
  out.close();
  if (!out)
    throw Error::failed("cannot write the depth file", file.string(),
                        "Check the free space of the disk");
  temporary.commit();
}

/// Adds the photometric parameters beyond contrast and brightness, if a camera has any.
void add_pixel_numbers(double camera, const schemas::PhotometricResponse& response,
                       std::vector<double>& numbers) {
  schemas::PhotometricResponse plain;
  plain.contrast = response.contrast;
  plain.brightness = response.brightness;
  if (response == plain) return;
  numbers.push_back(camera);
  for (const std::vector<double>& curve : response.curve) {
    numbers.push_back(static_cast<double>(curve.size()));
    numbers.insert(numbers.end(), curve.begin(), curve.end());
  }
  const schemas::Vignetting lens = response.vignetting.value_or(schemas::Vignetting{});
  numbers.insert(numbers.end(), {lens.cx, lens.cy, lens.a[0], lens.a[1], lens.a[2]});
  const schemas::GainMap map = response.gain_map.value_or(schemas::GainMap{});
  numbers.insert(numbers.end(), {double(map.columns), double(map.rows)});
  for (const schemas::Rgb& gain : map.gain) numbers.insert(numbers.end(), gain.begin(), gain.end());
  for (const schemas::Rgb& row : response.matrix)
    numbers.insert(numbers.end(), row.begin(), row.end());
  numbers.push_back(static_cast<double>(response.hot_pixels.size()));
  for (const schemas::HotPixel& pixel : response.hot_pixels) {
    numbers.insert(numbers.end(), {double(pixel.x), double(pixel.y), pixel.light[0], pixel.light[1],
                                   pixel.light[2]});
  }
}

/// Returns all numbers of a rig that depths depend on. Its file is not used, because it may have
/// changed.
std::vector<std::byte> numbers_of(const rig::Rig& rig) {
  std::vector<double> numbers;
  for (const rig::Rig::Camera& camera : rig.cameras) {
    const schemas::Intrinsics& k = camera.model.intrinsics();
    numbers.insert(numbers.end(), {static_cast<double>(camera.model.width()),
                                   static_cast<double>(camera.model.height()), k.fx, k.fy, k.cx,
                                   k.cy, k.distortion.k1, k.distortion.k2, k.distortion.p1,
                                   k.distortion.p2, k.distortion.k3});
    if (camera.model.fisheye() != nullptr) {
      numbers.push_back(static_cast<double>(k.projection));
      numbers.insert(numbers.end(), k.radial_distortion.begin(), k.radial_distortion.end());
      numbers.push_back(k.half_angle.value_or(0));
    }
    if (const rig::Facet* facet = camera.model.facet()) {
      numbers.insert(numbers.end(),
                     {facet->left, facet->right, facet->top, facet->bottom, facet->focal_length});
    }
    const Eigen::Matrix3d turned = camera.pose.world_from_camera_rotation.transpose();
    numbers.insert(numbers.end(), turned.data(), turned.data() + turned.size());
    numbers.insert(numbers.end(), camera.pose.position.begin(), camera.pose.position.end());
    for (const auto& values : {camera.photometric.brightness, camera.photometric.contrast}) {
      numbers.insert(numbers.end(), values.begin(), values.end());
    }
  }
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    add_pixel_numbers(static_cast<double>(i), rig.cameras[i].photometric, numbers);
  }
  // Earlier versions estimated other depths with cameras next to each other.
  const std::vector<int> stations = rig::camera_stations(rig);
  for (std::size_t i = 0; i < stations.size(); ++i) {
    const rig::Rig::Camera& first = rig.cameras[stations[i]];
    if (first.pose.position == rig.cameras[i].pose.position) continue;
    numbers.insert(numbers.end(), {static_cast<double>(i), static_cast<double>(stations[i])});
  }
  std::vector<std::byte> bytes(numbers.size() * sizeof(double));
  for (std::size_t i = 0; i < numbers.size(); ++i) {
    store_little_endian(bytes, i * sizeof(double), std::bit_cast<std::uint64_t>(numbers[i]));
  }
  return bytes;
}

bool is_fingerprint(const std::string& name) {
  return name.size() == kDigits && name.find_first_not_of("0123456789abcdef") == std::string::npos;
}

using UsedPath = std::pair<fs::file_time_type, fs::path>;  // by last use

/// Removes temporary files that ended processes left in the sets.
void remove_unfinished(std::span<const UsedPath> sets, fs::file_time_type now) {
  std::error_code error;
  for (const auto& [used, set] : sets) {
    std::vector<fs::path> unfinished;
    for (fs::directory_iterator entry(set, error), end; entry != end; entry.increment(error)) {
      const fs::path& path = entry->path();
      const std::string name = path.filename().string();
      if (!name.starts_with('.') || !name.ends_with(".tmp.zst")) continue;
      const fs::file_time_type written = fs::last_write_time(path, error);
      if (!error && now - written > kDepthSetUseTime) unfinished.push_back(path);
    }
    for (const fs::path& path : unfinished) fs::remove(path, error);
  }
}

constexpr std::string_view kPin = "pin.";

fs::path pin_file(const fs::path& set, std::string_view job) {
  constexpr std::size_t kLongest = 200;
  if (job.empty() || job.size() > kLongest || job.find('/') != std::string_view::npos ||
      job.find('\0') != std::string_view::npos) {
    throw Error::bad_input(
        fmt::format("the job name \"{}\" of a pin is not a file name of 1 to {} bytes", job,
                    kLongest),
        set.string(), "Name the job with letters, digits, - and _");
  }
  return set / fmt::format("{}{}", kPin, job);
}

/// Returns the hash that a file holds.
std::uint64_t content_of(const DepthStoreKey& key) {
  return key.regions == 0 ? key.instant : key.regions;
}

bool is_pinned(const fs::path& set, fs::file_time_type now) {
  std::error_code error;
  for (fs::directory_iterator entry(set, error), end; entry != end; entry.increment(error)) {
    if (!entry->path().filename().string().starts_with(kPin)) continue;
    const fs::file_time_type pinned = fs::last_write_time(entry->path(), error);
    if (!error && now - pinned <= kMaxPinTime) return true;
  }
  return false;
}

/// Returns the bytes that depths are estimated from. Pictures of more than 8 bits are not decoded.
store::FrameBytes bytes_of_frame(const store::ArchiveReader& archive, int frame) {
  return archive.pixel_encoding() ? archive.stored(frame) : archive.jpeg(frame);
}

/// Returns a hash with what the samples of pictures of more than 8 bits mean.
std::uint64_t with_encoding(const schemas::PixelEncoding& pixels, std::uint64_t hash) {
  std::array<std::byte, 20 + 8 * 8> bytes{};
  store_little_endian(bytes, 0, static_cast<std::uint32_t>(pixels.samples));
  store_little_endian(bytes, 4, static_cast<std::uint32_t>(pixels.bits));
  store_little_endian(bytes, 8, static_cast<std::uint32_t>(pixels.transfer));
  store_little_endian(bytes, 12, std::bit_cast<std::uint64_t>(pixels.peak));
  if (pixels.chromaticities) {
    for (std::size_t i = 0; i < pixels.chromaticities->size(); ++i) {
      store_little_endian(bytes, 20 + 8 * i,
                          std::bit_cast<std::uint64_t>((*pixels.chromaticities)[i]));
    }
  }
  return XXH3_64bits_withSeed(bytes.data(), bytes.size(), hash);
}

}  // namespace

DepthStoreKey depth_store_key(const LightFieldFrame& instant, const DepthEstimationOptions& s) {
  std::array<std::byte, 64> fixed{};
  store_little_endian(fixed, 0, kAlgorithm);
  store_little_endian(fixed, 4, static_cast<std::uint32_t>(instant.cache->blend_space()));
  store_little_endian(fixed, 8, std::bit_cast<std::uint64_t>(s.scene.near));
  store_little_endian(fixed, 16, std::bit_cast<std::uint64_t>(s.scene.far));
  store_little_endian(fixed, 24, std::bit_cast<std::uint64_t>(s.plane_px));
  store_little_endian(fixed, 32, std::bit_cast<std::uint64_t>(s.refine_px));
  store_little_endian(fixed, 40, std::bit_cast<std::uint64_t>(s.tolerance_px));
  store_little_endian(fixed, 48, static_cast<std::int64_t>(s.neighbours));
  store_little_endian(fixed, 56, static_cast<std::int64_t>(s.support_views));
  const std::string colours = instant.take->document().color_space;
  const std::vector<std::byte> rig = numbers_of(*instant.rig);
  DepthStoreKey key;
  key.set = XXH3_64bits(fixed.data(), fixed.size());
  key.set = XXH3_64bits_withSeed(colours.data(), colours.size(), key.set);
  key.set = XXH3_64bits_withSeed(rig.data(), rig.size(), key.set);
  key.instant = key.set;
  for (std::size_t i = 0; i < instant.frame_of_camera.size(); ++i) {
    const int frame = instant.frame_of_camera[i];
    const int camera =
        instant.camera_of_take.empty() ? static_cast<int>(i) : instant.camera_of_take[i];
    const auto add = [&](int added) {
      const store::FrameBytes bytes =
          added < 0 ? store::FrameBytes() : bytes_of_frame(instant.take->archive(camera), added);
      key.instant = XXH3_64bits_withSeed(bytes.data(), bytes.size(), key.instant);
    };
    if (const auto& pixels = instant.take->archive(camera).pixel_encoding()) {
      key.instant = with_encoding(*pixels, key.instant);
    }
    const auto sources = instant.cache->sources_of(frame);
    add(sources ? sources->first : frame);
    if (!sources) continue;
    add(sources->second);
    std::array<std::byte, 8> part{};
    store_little_endian(part, 0, std::bit_cast<std::uint64_t>(sources->part));
    key.instant = XXH3_64bits_withSeed(part.data(), part.size(), key.instant);
    if (sources->line_part == 0) continue;
    store_little_endian(part, 0, std::bit_cast<std::uint64_t>(sources->line_part));
    key.instant = XXH3_64bits_withSeed(part.data(), part.size(), key.instant);
  }
  if (s.regions.empty()) return key;
  std::vector<std::byte> bytes(s.regions.size() * 4 * sizeof(std::int32_t));
  std::size_t at = 0;
  for (const PixelRectangle& r : s.regions) {
    for (const std::int32_t value : {r.left, r.top, r.right, r.bottom}) {
      store_little_endian(bytes, at, value);
      at += sizeof(value);
    }
  }
  key.regions = XXH3_64bits_withSeed(bytes.data(), bytes.size(), key.instant);
  return key;
}

fs::path depth_file_path(const fs::path& folder, const DepthStoreKey& key) {
  const fs::path set = folder / "depth" / fmt::format("{:016x}", key.set);
  return set / (key.regions == 0 ? fmt::format("{:016x}.zst", key.instant)
                                 : fmt::format("{:016x}.{:016x}.zst", key.instant, key.regions));
}

void prune_depth_sets(const fs::path& folder, fs::file_time_type now) {
  std::error_code error;
  std::vector<UsedPath> sets, files;
  for (fs::directory_iterator entry(folder, error), end; entry != end; entry.increment(error)) {
    const fs::path& path = entry->path();
    const fs::file_status status = entry->symlink_status(error);
    const bool is_set = fs::is_directory(status) && is_fingerprint(path.filename().string());
    const bool is_file = fs::is_regular_file(status) && path.extension() == ".zst" &&
                         is_fingerprint(path.stem().string());
    if (!is_set && !is_file) continue;
    const fs::file_time_type used = fs::last_write_time(path, error);
    if (!error) (is_set ? sets : files).emplace_back(used, path);
  }
  remove_unfinished(sets, now);
  std::erase_if(sets, [now](const UsedPath& set) { return is_pinned(set.second, now); });
  std::ranges::sort(sets, std::greater());
  sets.erase(sets.begin(), sets.begin() + static_cast<std::ptrdiff_t>(
                                              std::min(sets.size(), kMaxStoredDepthSets)));
  for (const auto& old : {sets, files}) {
    for (const auto& [used, path] : old) {
      if (now - used > kDepthSetUseTime) fs::remove_all(path, error);
    }
  }
}

void prune_depth_regions(const fs::path& set, fs::file_time_type now) {
  constexpr std::string_view kEnd = ".zst";
  constexpr std::size_t kLength = 2 * kDigits + 1 + kEnd.size();
  std::error_code error;
  std::map<std::string, std::vector<UsedPath>> files;  // by INSTANT
  for (fs::directory_iterator entry(set, error), end; entry != end; entry.increment(error)) {
    const std::string name = entry->path().filename().string();
    const bool is_of_regions = name.size() == kLength && name[kDigits] == '.' &&
                               name.ends_with(kEnd) && is_fingerprint(name.substr(0, kDigits)) &&
                               is_fingerprint(name.substr(kDigits + 1, kDigits));
    if (!is_of_regions) continue;
    const fs::file_time_type used = fs::last_write_time(entry->path(), error);
    if (!error) files[name.substr(0, kDigits)].emplace_back(used, entry->path());
  }
  if (is_pinned(set, now)) return;
  for (auto& [instant, of_instant] : files) {
    std::ranges::sort(of_instant, std::greater());
    for (std::size_t i = kMaxStoredRegions; i < of_instant.size(); ++i) {
      if (now - of_instant[i].first > kDepthSetUseTime) fs::remove(of_instant[i].second, error);
    }
  }
}

CameraDepths load_or_estimate_camera_depths(const LightFieldFrame& instant,
                                            const DepthEstimationOptions& options,
                                            std::size_t working_bytes, bool stores_depths,
                                            std::string& note) {
  const DepthStoreKey key = stores_depths ? depth_store_key(instant, options) : DepthStoreKey{};
  const fs::path file = depth_file_path(instant.derived_folder(), key);
  if (stores_depths && !is_contained({instant.derived_folder(), depth_file_path({}, key)})) {
    // The link could lead to files of others, which would be overwritten and pruned.
    note = "depths are neither read nor stored, because a part of the path " + file.string() +
           " is a link, so each run estimates them again; use another folder for derived data";
    stores_depths = false;
  }
  if (stores_depths && store::is_bag_payload(instant.derived_folder())) {
    note =
        "depths are neither read nor stored, because the take is the payload of a bag, so each run "
        "estimates them again; copy the take out of the bag";
    stores_depths = false;
  }
  if (stores_depths) {
    CameraDepths depths = camera_depths_without_maps(instant, options);
    if (read_maps({instant.derived_folder(), depth_file_path({}, key)}, content_of(key), depths)) {
      if (key.regions != 0) mark_used(file);
      if (instant.stored_data_counts != nullptr) ++instant.stored_data_counts->read;
      return depths;
    }
  }
  CameraDepths depths = estimate_camera_depths(instant, options, working_bytes);
  if (instant.stored_data_counts != nullptr) ++instant.stored_data_counts->derived;
  for (InverseDepthMap& map : depths.maps) quantise_depths(map);
  if (!stores_depths) return depths;
  try {
    const fs::path set = file.parent_path();
    std::error_code error;
    const bool is_new = !fs::exists(set, error);
    create_folder(set);
    if (is_new) prune_depth_sets(set.parent_path(), fs::file_time_type::clock::now());
    write_maps(file, depths.maps, content_of(key));
    // A look at all files of the set, which may be many, after one file of sixteen.
    if (key.regions % 16 == 1) prune_depth_regions(set, fs::file_time_type::clock::now());
  } catch (const Error& error) {
    note = fmt::format("depths cannot be stored, so each run estimates them again: {}",
                       error.what_happened());
  }
  return depths;
}

StoreResult store_camera_depths(const LightFieldFrame& instant,
                                const DepthEstimationOptions& options, std::size_t working_bytes) {
  StoredDataCounts counts;
  LightFieldFrame counted = instant;
  counted.stored_data_counts = &counts;
  StoreResult result;
  load_or_estimate_camera_depths(counted, options, working_bytes, true, result.failure_reason);
  result.was_already_stored = counts.read > 0;
  return result;
}

void pin_depth_set(const fs::path& set, std::string_view job) {
  const fs::path pin = pin_file(set, job);
  const fs::path folder = set.parent_path().parent_path();
  require_contained({folder, pin.lexically_relative(folder)});
  if (store::is_bag_payload(folder)) return;  // nothing is stored there
  std::error_code error;
  const bool is_new = !fs::exists(set, error);
  create_folder(set);
  write_file_atomically(pin, std::string_view());
  // A pin may create the folder before the first depths.
  if (is_new) prune_depth_sets(set.parent_path(), fs::file_time_type::clock::now());
}

void unpin_depth_set(const fs::path& set, std::string_view job) {
  const fs::path pin = pin_file(set, job), folder = set.parent_path().parent_path();
  if (!is_contained({folder, pin.lexically_relative(folder)})) return;  // it was not pinned there
  std::error_code ignored;
  fs::remove(pin, ignored);
}

}  // namespace raystage::render
