// SPDX-License-Identifier: Apache-2.0
#include "dkb/dataset/tum_dataset.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <iterator>
#include <queue>
#include <set>
#include <tuple>

#include "dkb/util/errors.h"
#include "dkb/util/files.h"
#include "dkb/util/one_line.h"
#include "dkb/util/settings.h"
#include "dkb/util/stamps.h"
#include "dkb/util/text_rows.h"

namespace dkb {
namespace fs = std::filesystem;
namespace {

void require_columns(const std::vector<std::string_view>& columns, size_t wanted, const char* form,
                     const std::string& place) {
  if (columns.size() < wanted)
    throw InputError(place + ": " + std::to_string(columns.size()) + " of " + std::to_string(wanted) +
                     " columns; a row must be `" + form + "`");
}

// ICL-NUIM and some tools write the depth image first. It is told by the folders that the other image is not in as
// well, else by its name.
bool names_depth(std::string_view image, std::string_view other) {
  const fs::path path = fs::path(image).lexically_normal(), beside = fs::path(other).lexically_normal();
  const auto names = [](const fs::path& part) { return part.string().find("depth") != std::string::npos; };
  const auto own = std::mismatch(path.begin(), path.end(), beside.begin(), beside.end()).first;
  const auto name = std::prev(path.end());
  return own == name || own == path.end() ? names(*name) : std::any_of(own, name, names);
}

// Checks that each stamp lies after the one of the row before.
class RisingStamps {
 public:
  void add(double timestamp, const std::string& stamp, const std::string& place) {
    if (!before_.empty() && timestamp == last_)
      throw InputError(place + ": timestamp " + stamp + " is given twice; remove one of the rows");
    if (!before_.empty() && timestamp < last_)
      throw InputError(place + ": timestamp " + stamp + " is not after the line before it (" + before_ +
                       "); sort the file by time");
    last_ = timestamp, before_ = stamp;
  }

 private:
  double last_ = 0;
  std::string before_;
};

void set_exact_stamps(std::vector<DatasetPair>& pairs, const std::string& name) {
  const auto exact = [&](const std::string& stamp) {
    const auto ns = parse_stamp_ns(stamp);
    if (!ns) throw InputError(name + ": timestamp " + stamp + " is no time in seconds; give stamps below 9e9");
    return *ns;
  };
  for (DatasetPair& pair : pairs) pair.stamp_ns = exact(pair.stamp), pair.depth_stamp_ns = exact(pair.depth_stamp);
}

const std::vector<std::string> kColourEndings = {".png", ".jpg", ".jpeg"},
                               kDepthEndings = {".png", ".tiff", ".tif", ".pfm", ".npy"};

const char* const kKinds = "colour is PNG or JPEG, depth PNG, TIFF, PFM or NPY";

// As of a list: an image by its stamp, the name of the file, for each image of a folder; by rising stamps.
std::vector<ListRow> rows_by_name(const fs::path& folder, const std::string& images,
                                  const std::vector<std::string>& endings) {
  std::vector<ListRow> rows;
  std::error_code error;
  for (fs::directory_iterator it(folder / images, error), end; !error && it != end; it.increment(error)) {
    const fs::path name = it->path().filename();
    const std::string stamp = name.stem().string();
    if (stamp.starts_with(".") || std::find(endings.begin(), endings.end(), name.extension()) == endings.end())
      continue;
    if (!is_stamp(stamp))
      throw InputError(it->path().string() +
                       ": its name is no stamp in seconds, such as 1305031102.175304; rename the images, or list them "
                       "with their stamps in rgb.txt and depth.txt (docs/sources.md, \"Your own images\")");
    double seconds = 0;
    parse_number(stamp, &seconds);
    rows.push_back({seconds, stamp, (fs::path(images) / name).string()});
  }
  if (error) throw InputError((folder / images).string() + ": cannot be read (" + error.message() + ")");
  if (rows.empty())
    throw InputError((folder / images).string() + ": holds no image STAMP" + endings.front() +
                     other_endings(folder / images, endings));
  std::sort(rows.begin(), rows.end(), [](const ListRow& a, const ListRow& b) {
    return std::tie(a.timestamp, a.path) < std::tie(b.timestamp, b.path);
  });
  for (size_t i = 1; i < rows.size(); ++i)
    if (rows[i].timestamp == rows[i - 1].timestamp)
      throw InputError((folder / rows[i].path).string() + ": its stamp is that of " + rows[i - 1].path +
                       " as well; remove one of them");
  return rows;
}

// One to one, nearest stamps first. `list`: what names the images; `name`, `nothing` and `remedy` make the error where
// none has a partner.
TumDataset pair_rows(const fs::path& folder, const std::vector<ListRow>& colour, const std::vector<ListRow>& depth,
                     std::string list, const std::string& name, const std::string& nothing, const std::string& remedy) {
  TumDataset dataset;
  dataset.folder = folder;
  dataset.list = std::move(list);
  std::vector<double> colour_stamps, depth_stamps;
  for (const ListRow& row : colour) colour_stamps.push_back(row.timestamp);
  for (const ListRow& row : depth) depth_stamps.push_back(row.timestamp);
  for (const auto& [i, j] : associate(colour_stamps, depth_stamps)) {
    const ListRow &c = colour[i], &d = depth[j];
    dataset.pairs.push_back({c.timestamp, d.timestamp, 0, 0, c.stamp, d.stamp, folder / c.path, folder / d.path});
  }
  dataset.unpaired = colour.size() + depth.size() - 2 * dataset.pairs.size();
  if (dataset.pairs.empty())
    throw InputError(name + ": " + nothing + " within " + std::to_string(kPairDifference).substr(0, 5) + " s" + remedy);
  set_exact_stamps(dataset.pairs, name);
  return dataset;
}

}  // namespace

void DatasetSelection::check() const {
  if (skip_pairs < 0) throw InvalidOption("--skip-pairs", std::to_string(skip_pairs), "at least 0");
  if (!(std::isfinite(start) && start >= 0)) throw InvalidOption("--start", fmt::format("{:g}", start), "at least 0 s");
  if (!(end >= start))
    throw InvalidOption("--end", fmt::format("{:g}", end), fmt::format("at least that of --start, {:g} s", start));
  if (max_frames && *max_frames < 1) throw InvalidOption("--max-frames", std::to_string(*max_frames), "at least 1");
}

std::vector<ListRow> parse_image_list(const std::string& text, const std::string& name) {
  std::vector<ListRow> rows;
  RisingStamps rising;
  for_each_row(text, name, [&](const std::string& place, const std::vector<std::string_view>& columns) {
    const double timestamp = read_number(columns[0], place, "timestamp");
    require_columns(columns, 2, "timestamp filename", place);
    rows.push_back({timestamp, std::string(columns[0]), std::string(columns[1])});
    rising.add(timestamp, rows.back().stamp, place);
  });
  if (rows.empty()) throw InputError(name + ": holds no row `timestamp filename`");
  return rows;
}

std::vector<DatasetPair> parse_associations(const std::string& text, const std::string& name, const fs::path& folder) {
  std::vector<DatasetPair> pairs;
  RisingStamps rising;
  for_each_row(text, name, [&](const std::string& place, const std::vector<std::string_view>& columns) {
    DatasetPair pair;
    read_number(columns[0], place, "timestamp");
    require_columns(columns, 4, "rgb_timestamp rgb_file depth_timestamp depth_file", place);
    const size_t c = names_depth(columns[1], columns[3]) && !names_depth(columns[3], columns[1]) ? 2 : 0, d = 2 - c;
    pair.timestamp = read_number(columns[c], place, "timestamp");
    pair.depth_timestamp = read_number(columns[d], place, "depth timestamp");
    pair.stamp = columns[c], pair.depth_stamp = columns[d];
    pair.colour_path = folder / columns[c + 1], pair.depth_path = folder / columns[d + 1];
    rising.add(pair.timestamp, pair.stamp, place);
    pairs.push_back(std::move(pair));
  });
  if (pairs.empty()) throw InputError(name + ": holds no row `rgb_timestamp rgb_file depth_timestamp depth_file`");
  return pairs;
}

std::vector<std::pair<size_t, size_t>> associate(const std::vector<double>& a, const std::vector<double>& b,
                                                 double max_difference) {
  // The nearest free pair is one of neighbours in time: whatever lay between the two would be nearer to one of them. So
  // only neighbours are candidates, and taking a pair out makes at most one new pair of neighbours.
  struct Candidate {
    double difference;
    size_t i, j;         // of a, of b
    size_t left, right;  // their places in `all`
    bool operator>(const Candidate& other) const {
      return std::tie(difference, i, j) > std::tie(other.difference, other.i, other.j);
    }
  };
  struct Stamp {
    bool of_b;
    size_t index;
    size_t before, after;  // neighbours that are free; 0 and the last place are ends
    bool taken = false;
  };
  std::vector<Stamp> all{{false, 0, 0, 1}};
  all.reserve(a.size() + b.size() + 2);
  for (size_t i = 0, j = 0; i < a.size() || j < b.size();) {
    const bool of_b = i == a.size() || (j < b.size() && b[j] < a[i]);
    all.push_back({of_b, of_b ? j++ : i++, all.size() - 1, all.size() + 1});
  }
  const size_t end = all.size();
  all.push_back({false, 0, end - 1, end});

  const double limit = max_difference + kStampRounding;
  std::priority_queue<Candidate, std::vector<Candidate>, std::greater<>> nearest;
  const auto offer = [&](size_t left, size_t right) {
    if (left == 0 || right == end || all[left].of_b == all[right].of_b) return;
    const size_t i = all[all[left].of_b ? right : left].index, j = all[all[left].of_b ? left : right].index;
    if (b[j] >= a[i] - limit && b[j] <= a[i] + limit) nearest.push({std::abs(a[i] - b[j]), i, j, left, right});
  };
  for (size_t k = 1; k + 1 < end; ++k) offer(k, k + 1);
  std::vector<std::pair<size_t, size_t>> result;
  while (!nearest.empty()) {
    const Candidate c = nearest.top();
    nearest.pop();
    if (all[c.left].taken || all[c.right].taken) continue;
    all[c.left].taken = all[c.right].taken = true;
    result.emplace_back(c.i, c.j);
    const size_t before = all[c.left].before, after = all[c.right].after;
    all[before].after = after, all[after].before = before;
    offer(before, after);
  }
  std::sort(result.begin(), result.end());
  return result;
}

std::string other_endings(const fs::path& folder, const std::vector<std::string>& endings) {
  std::set<std::string> others;
  std::error_code error;
  for (fs::directory_iterator it(folder, error), end; !error && it != end; it.increment(error)) {
    const std::string ending = it->path().extension().string();
    if (!ending.empty() && !it->path().filename().string().starts_with('.') &&
        std::find(endings.begin(), endings.end(), ending) == endings.end())
      others.insert(excerpt(ending));
  }
  if (others.empty()) return "";
  std::string text;
  for (const std::string& ending : others)
    if (text.size() < 40) text += (text.empty() ? "" : ", ") + ending;
  return ", but " + text + "; " + kKinds;
}

bool has_tum_lists(const fs::path& folder) {
  std::error_code error;
  return fs::exists(folder / "associations.txt", error) || fs::exists(folder / "rgb.txt", error);
}

TumDataset open_tum_dataset(const fs::path& folder) {
  std::error_code ec;
  if (!fs::exists(folder, ec)) throw InputError(folder.string() + ": no such folder");
  if (!fs::is_directory(folder, ec))
    throw InputError(folder.string() +
                     ": is not a folder; give the folder that holds associations.txt or rgb.txt (docs/sources.md names "
                     "the recordings and the other layouts that can be read)");

  TumDataset dataset;
  dataset.folder = folder;
  const fs::path associations = folder / "associations.txt", rgb = folder / "rgb.txt", depth = folder / "depth.txt";
  if (fs::exists(associations, ec)) {
    dataset.list = "associations.txt";
    dataset.pairs = parse_associations(read_file(associations), associations.string(), folder);
    set_exact_stamps(dataset.pairs, associations.string());
    return dataset;
  }
  for (const fs::path& list : {rgb, depth})
    if (!fs::exists(list, ec))
      throw InputError(list.string() +
                       ": no such file; a dataset needs associations.txt, or rgb.txt and depth.txt, with a line " +
                       "`seconds image` for each image, or images named rgb/STAMP.png and depth/STAMP.png; " + kKinds +
                       " (docs/sources.md, \"Your own images\")");
  return pair_image_lists(folder, "rgb.txt", "depth.txt");
}

TumDataset pair_image_lists(const fs::path& folder, const std::string& colour_list, const std::string& depth_list) {
  const fs::path rgb = folder / colour_list, depth = folder / depth_list;
  const std::vector<ListRow> colour_rows = parse_image_list(read_file(rgb), rgb.string());
  const std::vector<ListRow> depth_rows = parse_image_list(read_file(depth), depth.string());
  return pair_rows(folder, colour_rows, depth_rows, colour_list + " and " + depth_list, rgb.string(),
                   "no colour image has a depth image of " + depth_list,
                   "; the two lists must be of one recording and one clock");
}

bool is_stamp(std::string_view name) {
  return !name.empty() && name.find_first_not_of("0123456789.") == std::string_view::npos && parse_stamp_ns(name);
}

TumDataset pair_image_folders(const fs::path& folder, const std::string& colour_folder,
                              const std::string& depth_folder) {
  const std::vector<ListRow> colour_rows = rows_by_name(folder, colour_folder, kColourEndings);
  const std::vector<ListRow> depth_rows = rows_by_name(folder, depth_folder, kDepthEndings);
  return pair_rows(folder, colour_rows, depth_rows, "the names in " + colour_folder + " and " + depth_folder,
                   (folder / colour_folder).string(), "no image has one of " + depth_folder + " whose name is a stamp",
                   " of its own; the names must be of one recording and one clock, in seconds");
}

bool PairFilter::wants(double timestamp) {
  if (seen_++ < selection_.skip_pairs) return false;
  if (seen_ == selection_.skip_pairs + 1) origin_ = timestamp;
  last_ = timestamp;
  const double t = timestamp - origin_;
  ended_ = ended_ || t > selection_.end + kStampRounding;
  if (t < selection_.start - kStampRounding || done()) return false;
  ++taken_;
  return true;
}

void PairFilter::require_any(const std::string& name) const {
  if (seen_ <= selection_.skip_pairs)
    throw InputError(name + ": --skip-pairs " + std::to_string(selection_.skip_pairs) +
                     " leaves nothing; the sequence has " + std::to_string(seen_) + " pairs");
  if (taken_ == 0)
    throw InputError(name + ": no pair lies between --start and --end; the sequence lasts " +
                     std::to_string(last_ - origin_) + " s");
}

void select_pairs(const DatasetSelection& selection, TumDataset* dataset) {
  PairFilter filter(selection);
  std::vector<DatasetPair> kept;
  for (DatasetPair& pair : dataset->pairs)
    if (filter.wants(pair.timestamp)) kept.push_back(std::move(pair));
  if (!dataset->pairs.empty()) filter.require_any(dataset->folder.string());
  dataset->pairs = std::move(kept);
}

}  // namespace dkb
