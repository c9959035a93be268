// SPDX-License-Identifier: Apache-2.0
// Imports depth maps made elsewhere. Finds the files of the cameras' frames, reads them, converts
// them to inverse depths (pinholes) or inverse distances (fisheyes), checks them (map_checks.h) and
// writes one file each, whose name has the hash of its contents; then the list of all maps,
// atomically. Files that the list does not name are removed last. Cost: decoding and encoding, in
// parallel over the files.
#include "depths/import_depths.h"

#include <fmt/format.h>
#include <xxhash.h>

#include <algorithm>
#include <atomic>
#include <charconv>
#include <chrono>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <utility>

#include "base/atomic_file.h"
#include "base/cancellation.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "base/options.h"
#include "base/parallel.h"
#include "depths/depth_image.h"
#include "depths/fit_maps.h"
#include "depths/import_lock.h"
#include "depths/map_checks.h"
#include "render/depth/imported_maps.h"
#include "schemas/imported_depths_document.h"
#include "store/fixity/sha256.h"
#include "store/imported_depths.h"
#include "store/timeline.h"

namespace raystage::depths {
namespace {

namespace fs = std::filesystem;
using Document = schemas::ImportedDepthsDocument;

/// A file to import.
struct Source {
  fs::path relative;  ///< in the folder
  int camera = 0, frame = 0;
};

std::vector<std::string> names_of(const std::vector<Source>& sources) {
  std::vector<std::string> names;
  for (const Source& source : sources) names.push_back(source.relative.string());
  return names;
}

/// Finds the files of a folder and their frames.
class SourceFinder {
 public:
  SourceFinder(const store::Take& take, fs::path folder, MapNumbers numbers)
      : take_(take), folder_(std::move(folder)), numbers_(numbers) {
    if (numbers == MapNumbers::kTicks) timeline_ = store::read_timeline(take);
  }

  std::vector<Source> find() {
    for (const auto& [name, is_folder] : entries({})) {
      const fs::path path(name);
      if (!is_folder && !is_map(path)) continue;  // other tables and documents of that folder
      const std::string id = is_folder ? name : path.stem().string();
      const int camera = take_.camera_index(id);
      if (camera < 0) throw unknown_camera(name, id);
      if (is_folder) {
        add_folder(path, camera);
      } else {
        add_still(path, camera);
      }
    }
    if (sources_.empty()) {
      throw Error::bad_input("the folder has no depth maps of the take's frames", folder_.string(),
                             "Give a folder with CAMERA/000001.exr or .png, or CAMERA.exr or .png");
    }
    return std::move(sources_);
  }
  /// Files of frames that the take does not have.
  const std::vector<std::string>& without_frame() const { return without_frame_; }

 private:
  static bool is_map(const fs::path& file) { return is_exr_file(file) || is_png_file(file); }

  /// Returns the visible entries of a folder by name, and whether they are folders.
  std::map<std::string, bool> entries(const fs::path& relative) const {
    std::map<std::string, bool> found;
    std::error_code error;
    const fs::path folder = folder_ / relative;
    for (fs::directory_iterator entry(folder, error), end; !error && entry != end;
         entry.increment(error)) {
      const std::string name = entry->path().filename().string();
      std::error_code unknown;
      const fs::file_status status = entry->symlink_status(unknown);
      if (!name.starts_with('.')) found.emplace(name, fs::is_directory(status));
    }
    if (error) {
      throw Error::bad_input("the folder cannot be read: " + error.message(), folder.string(),
                             "Give the folder of the depth maps");
    }
    return found;
  }

  Error unknown_camera(const std::string& name, const std::string& id) const {
    std::vector<std::string> ids;
    for (const auto& camera : take_.document().cameras) ids.push_back(camera.id);
    return Error::bad_input(
        fmt::format("the take has no camera \"{}\"; it has {}", id, list_of(ids)),
        (folder_ / name).string(), "Name folders and files of depth maps by the cameras' ids");
  }

  void add_folder(const fs::path& relative, int camera) {
    for (const auto& [name, is_folder] : entries(relative)) {
      const fs::path path = relative / name;
      if (is_folder || !is_map(path)) continue;
      const std::string stem = path.stem().string();
      int number = 0;
      const char* end = stem.data() + stem.size();
      const auto [used, error] = std::from_chars(stem.data(), end, number);
      if (error != std::errc() || used != end || number < 1) {
        throw Error::bad_input("the name of the depth map is no number from 1",
                               (folder_ / path).string(),
                               "Name depth maps by their frame: 000001.exr is the first");
      }
      add(path, camera, number);
    }
  }

  void add_still(const fs::path& relative, int camera) {
    const std::size_t frames =
        timeline_ ? timeline_->ticks.size() : take_.archive(camera).frames().size();
    if (frames != 1) {
      throw Error::bad_input(
          fmt::format("a depth map without a frame number, but the take has {} frames", frames),
          (folder_ / relative).string(), "Give a folder per camera: CAMERA/000001.exr");
    }
    add(relative, camera, 1);
  }

  void add(const fs::path& relative, int camera, int number) {
    const auto at = static_cast<std::size_t>(number) - 1;
    const std::size_t last =
        timeline_ ? timeline_->ticks.size() : take_.archive(camera).frames().size();
    if (at >= last) {
      throw Error::bad_input(
          fmt::format("there is no frame {}: {} has {}", number,
                      timeline_ ? "the take's timeline" : "the camera", last),
          (folder_ / relative).string(),
          "Name depth maps by their frame, and check whether they count ticks or recorded frames");
    }
    const int frame = timeline_ ? timeline_->ticks[at].frame[camera] : static_cast<int>(at);
    if (frame < 0) {
      without_frame_.push_back(relative.string());
      return;
    }
    if (!sources_.empty() && is_exr_file(sources_[0].relative) != is_exr_file(relative)) {
      throw Error::bad_input("the folder has depth maps in EXR and in PNG", folder_.string(),
                             "Import one format at a time");
    }
    const auto [known, is_new] = by_frame_.try_emplace({camera, frame}, relative.string());
    if (!is_new) {
      throw Error::bad_input("the depth maps " + known->second + " and " + relative.string() +
                                 " are of the same frame",
                             folder_.string(), "Give one depth map a frame");
    }
    sources_.push_back({relative, camera, frame});
  }

  const store::Take& take_;
  fs::path folder_;
  MapNumbers numbers_;
  std::optional<store::Timeline> timeline_;  ///< set if numbers are ticks
  std::vector<Source> sources_;
  std::map<std::pair<int, int>, std::string> by_frame_;
  std::vector<std::string> without_frame_;
};

/// Throws Error (bad input) if a map has not the shape of the camera's pictures, or is so small
/// that rounded sides say little about its shape.
void require_shape(const render::InverseDepthMap& map, const rig::CameraModel& model,
                   const fs::path& file) {
  constexpr int kMaxScale = 16, kMinSide = 8;
  const auto is_small = [&](int side, int of_pictures) {
    return side < std::min(kMinSide, of_pictures) || (side + 1) * kMaxScale <= of_pictures;
  };
  if (is_small(map.width, model.width()) || is_small(map.height, model.height())) {
    throw Error::bad_input(
        fmt::format("the depth map has {}x{} pixels, allowed: at least {} and a {}th of the "
                    "camera's pictures, {}x{}, along each side",
                    map.width, map.height, kMinSide, kMaxScale, model.width(), model.height()),
        file.string(), "Export larger depth maps");
  }
  const double width = model.width(), height = model.height();
  // Sides of scaled maps are rounded to whole pixels, up or down: the shorter one may differ by one
  // pixel from that of the longer one's scale.
  const double difference = std::abs(map.width * height - map.height * width);
  if (difference <= std::max(width, height)) return;
  throw Error::bad_input(
      fmt::format("the depth map has {}x{} pixels, the camera's pictures have {}x{}: the shapes "
                  "differ",
                  map.width, map.height, model.width(), model.height()),
      file.string(), "Export depth maps of the whole recorded pictures, at any resolution");
}

/// Reads, converts and writes the maps.
class Importer {
 public:
  Importer(const store::Take& take, const fs::path& folder, const DepthImportOptions& options)
      : take_(take),
        folder_(folder),
        options_(options),
        lock_(take),
        parallaxes_(neighbour_parallaxes(take.rig())) {}
  Importer(const Importer&) = delete;
  Importer& operator=(const Importer&) = delete;
  ~Importer() {
    std::error_code ignored;
    if (is_listed_) return;
    for (const std::string& file : written_) {
      if (!file.empty()) fs::remove(stored(file), ignored);
    }
    if (has_begun_list_) fs::remove(take_.folder() / Document::kFile, ignored);
  }

  DepthImportReport run(const std::vector<Source>& sources) {
    require_contained(take_.file(Document::kFile));
    Document document = store::read_imported_depths(take_);
    const std::size_t lost = fit_maps_to_frames(document, take_);
    require_new(document, sources);
    begin_list();
    std::vector<Document::Map> maps(sources.size());
    written_.resize(sources.size());
    std::vector<MapFindings> findings(sources.size());
    std::atomic<std::size_t> done = 0;
    parallel_for(std::size_t{0}, sources.size(), [&](std::size_t i, const ParallelLoop& loop) {
      if (loop.failed()) return;
      maps[i] = import(sources[i], written_[i], findings[i]);
      options_.progress(static_cast<double>(++done) / static_cast<double>(sources.size()));
    });
    DepthImportReport report = list(document, sources, maps);
    lock_.remove_unlisted(take_, document);
    report.notes = notes_about(findings, names_of(sources));
    if (lost > 0) {
      report.notes.push_back(
          fmt::format("maps of frames that the take no longer has were removed: {}", lost));
    }
    for (const MapFindings& found : findings) report.too_near += found.too_near;
    return report;
  }

 private:
  fs::path stored(const std::string& file) const {
    return take_.folder() / Document::kFolder / file;
  }

  /// Writes an empty list before the first maps: maps without a list are those of a list that was
  /// lost, not of an import that was killed.
  void begin_list() {
    if (exists(take_.file(Document::kFile))) return;
    schemas::write_imported_depths({}, take_.folder() / Document::kFile);
    has_begun_list_ = true;
  }

  void require_new(const Document& document, const std::vector<Source>& sources) const {
    if (options_.overwrites) return;
    for (const Source& source : sources) {
      const std::string& id = take_.document().cameras[source.camera].id;
      if (document.find(id, source.frame) == nullptr) continue;
      throw Error::bad_input(
          fmt::format("the take has an imported depth map of frame {} of camera \"{}\" already",
                      source.frame, id),
          (folder_ / source.relative).string(), "Allow that existing maps are overwritten");
    }
  }

  Document::Map import(const Source& source, std::string& written, MapFindings& found) const {
    const fs::path file = folder_ / source.relative;
    const rig::CameraModel& model = take_.rig().cameras[source.camera].model;
    Document::Map result;
    result.source_sha256 =
        store::sha256_of_file({folder_, source.relative}, [](std::size_t) { return true; });
    render::InverseDepthMap map = reader_.read(file, options_.encoding);
    require_shape(map, model, file);
    const render::DepthQuantity quantity = render::stored_quantity(model);
    render::convert_recorded_depths(map, model, options_.encoding.quantity, quantity);
    found = check_map(map, parallaxes_[source.camera], take_.document().depth_range);
    result.frame = source.frame;
    result.frame_xxh3 = render::imported_frame_xxh3(take_, source.camera, source.frame);
    result.quantity = quantity == render::DepthQuantity::kPlanar
                          ? Document::Quantity::kInverseDepth
                          : Document::Quantity::kInverseDistance;
    result.width = map.width;
    result.height = map.height;
    const auto unknown = std::ranges::count_if(map.values, [](float value) { return value < 0; });
    result.unknown_share = static_cast<double>(unknown) / static_cast<double>(map.values.size());
    result.source = source.relative.string();
    const std::vector<std::byte> bytes = render::encode_imported_map(map, result.frame_xxh3);
    result.file = fmt::format("{}/{:06}.{:016x}.zst", take_.document().cameras[source.camera].id,
                              source.frame, XXH3_64bits(bytes.data(), bytes.size()));
    const fs::path target = stored(result.file);
    require_contained(take_.file(fs::path(Document::kFolder) / result.file));
    create_folder(target.parent_path());
    if (!file_exists(target)) written = result.file;
    write_file_atomically(target, bytes);
    return result;
  }

  /// Writes the list with the new maps and removes the files that they replace.
  DepthImportReport list(Document& document, const std::vector<Source>& sources,
                         const std::vector<Document::Map>& maps) {
    const bool is_exr = is_exr_file(sources[0].relative);
    const auto now = std::chrono::system_clock::now().time_since_epoch();
    document.imports.push_back(
        {std::chrono::duration_cast<std::chrono::nanoseconds>(now).count(), options_.created_by,
         fs::absolute(folder_).lexically_normal().string(), describe(options_.encoding, is_exr)});
    DepthImportReport report;
    std::set<int> cameras;
    std::vector<std::string> replaced;
    for (std::size_t i = 0; i < sources.size(); ++i) {
      const std::string& id = take_.document().cameras[sources[i].camera].id;
      cameras.insert(sources[i].camera);
      report.unknown_share += maps[i].unknown_share / static_cast<double>(sources.size());
      auto camera = std::ranges::find(document.cameras, id, &Document::Camera::id);
      if (camera == document.cameras.end()) {
        camera = document.cameras.insert(camera, Document::Camera{id, {}});
      }
      Document::Map map = maps[i];
      map.import = static_cast<int>(document.imports.size()) - 1;
      const auto at = std::ranges::lower_bound(camera->maps, map.frame, {}, &Document::Map::frame);
      if (at != camera->maps.end() && at->frame == map.frame) {
        if (at->file != map.file) replaced.push_back(at->file);
        ++report.replaced;
        *at = std::move(map);
      } else {
        camera->maps.insert(at, std::move(map));
      }
    }
    drop_unused_imports(document);
    schemas::write_imported_depths(document, take_.folder() / Document::kFile);
    is_listed_ = true;
    std::error_code ignored;
    for (const std::string& file : replaced) {
      if (is_contained(take_.file(fs::path(Document::kFolder) / file))) {
        fs::remove(stored(file), ignored);
      }
    }
    report.maps = maps.size();
    report.cameras = static_cast<int>(cameras.size());
    return report;
  }

  static void drop_unused_imports(Document& document) {
    std::map<int, int> number_of;  // new number by old
    for (const Document::Camera& camera : document.cameras) {
      for (const Document::Map& map : camera.maps) number_of.emplace(map.import, 0);
    }
    std::vector<Document::Import> used;
    for (auto& [old, number] : number_of) {
      number = static_cast<int>(used.size());
      used.push_back(document.imports[static_cast<std::size_t>(old)]);
    }
    document.imports = std::move(used);
    for (Document::Camera& camera : document.cameras) {
      for (Document::Map& map : camera.maps) map.import = number_of.at(map.import);
    }
  }

  const store::Take& take_;
  const fs::path& folder_;
  const DepthImportOptions& options_;
  ImportLock lock_;                 ///< held until the destructor has removed files
  std::vector<double> parallaxes_;  ///< by camera
  DepthImageReader reader_;
  std::vector<std::string> written_;  ///< new files, removed unless the list names them
  bool is_listed_ = false, has_begun_list_ = false;
};

}  // namespace

DepthImportReport import_depths(const store::Take& take, const fs::path& folder,
                                const DepthImportOptions& options, const std::stop_token& stop) {
  require_valid(options.encoding, "depth images");
  const CancellationScope scope(stop);
  SourceFinder finder(take, folder, options.numbers);
  const std::vector<Source> sources = finder.find();
  DepthImportReport report = Importer(take, folder, options).run(sources);
  if (!finder.without_frame().empty()) {
    report.notes.push_back(fmt::format(
        "{} depth maps were not imported, because the camera has no frame at their time: {}",
        finder.without_frame().size(), list_of(finder.without_frame())));
  }
  return report;
}

}  // namespace raystage::depths
