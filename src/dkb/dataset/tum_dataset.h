// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "dkb/util/stamps.h"

namespace dkb {

// One colour image and the depth image that goes with it.
struct DatasetPair {
  double timestamp = 0;                      // [s] of the colour image
  double depth_timestamp = 0;                // [s] of the depth image
  int64_t stamp_ns = 0, depth_stamp_ns = 0;  // the same, exactly
  std::string stamp;                         // the colour image's, as written in the list
  std::string depth_stamp;                   // the depth image's
  std::filesystem::path colour_path;         // list's folder / name in the list
  std::filesystem::path depth_path;
};

inline constexpr double kPairDifference = 0.02;                         // [s] most between the stamps of a pair
inline constexpr double kPairLimit = kPairDifference + kStampRounding;  // [s] the same of stamps that were rounded

struct TumDataset {
  std::filesystem::path folder;
  std::string list;                // what pairs them: "associations.txt", "rgb.txt and depth.txt", "the names in ..."
  std::vector<DatasetPair> pairs;  // colour stamps strictly rising, at least one
  size_t unpaired = 0;             // images without a partner, of the whole folder
};

// What a folder holds in the place of files with these endings: ", but .bmp; colour is PNG or JPEG, ..."; empty where
// it holds nothing else.
std::string other_endings(const std::filesystem::path& folder, const std::vector<std::string>& endings);

// Whether a folder is in TUM layout, by what lies in it.
bool has_tum_lists(const std::filesystem::path& folder);

// Reads the lists of a folder in TUM layout (no image is opened): the rows of associations.txt as they are
// (`rgb_stamp rgb_path depth_stamp depth_path`, or depth first: told by the folders' names) when it is there, else
// rgb.txt and depth.txt (`stamp path`), paired one to one, nearest stamps first. Comments, blank lines and CRLF are
// fine. Throws InputError with file:line: folder or lists missing or empty; a row malformed, with too few columns, with
// a stamp that is not finite, repeated or out of order; nothing pairs. In associations.txt depth stamps may repeat.
TumDataset open_tum_dataset(const std::filesystem::path& folder);

// Likewise by two lists of these names alone.
TumDataset pair_image_lists(const std::filesystem::path& folder, const std::string& colour_list,
                            const std::string& depth_list);

// The same without lists, where images are named by their stamps [s]: COLOUR/1305031102.175304.png. Files that are no
// images by their endings are left alone. Throws InputError naming the image whose name is no stamp, or one that
// another image has as well.
TumDataset pair_image_folders(const std::filesystem::path& folder, const std::string& colour_folder,
                              const std::string& depth_folder);

// Whether the name of an image, without its ending, is a stamp: plain decimals, below 9e9 s.
bool is_stamp(std::string_view name);

// The rows of one list, parsed from text; `name` opens the messages.
struct ListRow {
  double timestamp = 0;
  std::string stamp;
  std::string path;
};
std::vector<ListRow> parse_image_list(const std::string& text, const std::string& name);
std::vector<DatasetPair> parse_associations(const std::string& text, const std::string& name,
                                            const std::filesystem::path& folder);

// Index pairs (i of a, j of b), rising in i: each used once, nearest stamps first (ties: earlier i, then earlier j).
std::vector<std::pair<size_t, size_t>> associate(const std::vector<double>& a, const std::vector<double>& b,
                                                 double max_difference = kPairDifference);

// What --skip-pairs, --start, --end and --max-frames choose.
struct DatasetSelection {
  int64_t skip_pairs = 0;                                // left out at the beginning before all else, >= 0
  double start = 0;                                      // [s] after the first pair's colour stamp, inclusive, >= 0
  double end = std::numeric_limits<double>::infinity();  // [s] likewise, inclusive, >= start
  std::optional<int64_t> max_frames;                     // pairs counted from start, >= 1
  void check() const;                                    // throws InvalidOption
};

// The same for pairs that come one by one, colour stamps rising.
class PairFilter {
 public:
  explicit PairFilter(const DatasetSelection& selection) : selection_(selection) { selection_.check(); }
  bool wants(double timestamp);
  // No later pair is wanted.
  bool done() const { return ended_ || (selection_.max_frames && taken_ >= *selection_.max_frames); }
  int64_t seen() const { return seen_; }
  // Throws InputError, which begins with `name`, when all pairs have been shown and none was wanted.
  void require_any(const std::string& name) const;

 private:
  DatasetSelection selection_;
  int64_t seen_ = 0, taken_ = 0;
  double origin_ = 0, last_ = 0;
  bool ended_ = false;
};
// Throws InputError when nothing is left.
void select_pairs(const DatasetSelection& selection, TumDataset* dataset);

}  // namespace dkb
