// SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <stdexcept>

#include "dkb/recordings/recording_file.h"
#include "dkb/util/errors.h"

#if DKB_HAS_BZ2
#include <bzlib.h>
#endif
#if DKB_HAS_LZ4
#include <lz4frame.h>
#endif
#if DKB_HAS_ZSTD
#include <zstd.h>
#endif

namespace dkb {
namespace {

// Decompresses a stream piece by piece.
class Decoder {
 public:
  virtual ~Decoder() = default;
  // Advances both ranges by what was taken and made. True at the end of the stream. Throws std::runtime_error.
  virtual bool step(std::string_view* in, char** out, size_t* room) = 0;
};

void advance(std::string_view* in, size_t taken, char** out, size_t made, size_t* room) {
  in->remove_prefix(taken);
  *out += made;
  *room -= made;
}

#if DKB_HAS_BZ2
class Bz2Decoder final : public Decoder {
 public:
  Bz2Decoder() {
    if (BZ2_bzDecompressInit(&stream_, 0, 0) != BZ_OK) throw std::bad_alloc();
  }
  ~Bz2Decoder() override { BZ2_bzDecompressEnd(&stream_); }
  Bz2Decoder(const Bz2Decoder&) = delete;
  Bz2Decoder& operator=(const Bz2Decoder&) = delete;
  bool step(std::string_view* in, char** out, size_t* room) override {
    const size_t given = std::min<size_t>(in->size(), 1 << 30), space = std::min<size_t>(*room, 1 << 30);
    stream_.next_in = const_cast<char*>(in->data());  // it only reads
    stream_.avail_in = static_cast<unsigned>(given);
    stream_.next_out = *out;
    stream_.avail_out = static_cast<unsigned>(space);
    const int result = BZ2_bzDecompress(&stream_);
    if (result != BZ_OK && result != BZ_STREAM_END) throw std::runtime_error("bz2: error " + std::to_string(-result));
    advance(in, given - stream_.avail_in, out, space - stream_.avail_out, room);
    return result == BZ_STREAM_END;
  }

 private:
  bz_stream stream_{};
};
#endif

#if DKB_HAS_LZ4
class Lz4Decoder final : public Decoder {
 public:
  Lz4Decoder() {
    LZ4F_dctx* made = nullptr;
    if (LZ4F_isError(LZ4F_createDecompressionContext(&made, LZ4F_VERSION))) throw std::bad_alloc();
    context_.reset(made);
  }
  bool step(std::string_view* in, char** out, size_t* room) override {
    size_t made = *room, taken = in->size();
    const size_t hint = LZ4F_decompress(context_.get(), *out, &made, in->data(), &taken, nullptr);
    if (LZ4F_isError(hint)) throw std::runtime_error(std::string("lz4: ") + LZ4F_getErrorName(hint));
    advance(in, taken, out, made, room);
    return hint == 0;
  }

 private:
  struct Free {
    void operator()(LZ4F_dctx* context) const { LZ4F_freeDecompressionContext(context); }
  };
  std::unique_ptr<LZ4F_dctx, Free> context_;
};
#endif

#if DKB_HAS_ZSTD
class ZstdDecoder final : public Decoder {
 public:
  ZstdDecoder() : stream_(ZSTD_createDStream()) {
    if (stream_ == nullptr) throw std::bad_alloc();
  }
  bool step(std::string_view* in, char** out, size_t* room) override {
    ZSTD_inBuffer from{in->data(), in->size(), 0};
    ZSTD_outBuffer to{*out, *room, 0};
    const size_t hint = ZSTD_decompressStream(stream_.get(), &to, &from);
    if (ZSTD_isError(hint)) throw std::runtime_error(std::string("zstd: ") + ZSTD_getErrorName(hint));
    advance(in, from.pos, out, to.pos, room);
    return hint == 0;
  }

 private:
  struct Free {
    void operator()(ZSTD_DStream* stream) const { ZSTD_freeDStream(stream); }
  };
  std::unique_ptr<ZSTD_DStream, Free> stream_;
};
#endif

std::unique_ptr<Decoder> make_decoder(Compression compression) {
#if DKB_HAS_BZ2
  if (compression == Compression::bz2) return std::make_unique<Bz2Decoder>();
#endif
#if DKB_HAS_LZ4
  if (compression == Compression::lz4) return std::make_unique<Lz4Decoder>();
#endif
#if DKB_HAS_ZSTD
  if (compression == Compression::zstd) return std::make_unique<ZstdDecoder>();
#endif
  (void)compression;
  throw std::logic_error("a compression that was not built in");
}

// Doubles the buffer, up to `size` bytes.
void grow(ChunkBuffer* out, uint64_t size) {
  const uint64_t more = std::max<uint64_t>(2 * out->bytes.size(), 1 << 20);
  out->bytes.resize(static_cast<size_t>(std::max<uint64_t>(out->bytes.size(), std::min(more, size))));
}

ChunkState copy_chunk(const RecordingFile& file, uint64_t at, uint64_t size, ChunkBuffer* out) {
  const uint64_t left = at < file.size() ? file.size() - at : 0;
  const size_t there = static_cast<size_t>(std::min(size, left));
  if (out->bytes.size() < there) out->bytes.resize(there);
  out->size = file.read(at, out->bytes.data(), there);
  return {out->size < size ? ChunkState::cut : ChunkState::whole, ""};
}

}  // namespace

Compression compression_named(std::string_view name) {
  const auto built_in = [](bool there, const char* what, const char* package) {
    if (!there)
      throw InputError(std::string("this build has no ") + what + " compression; install " + package +
                       " and build again");
  };
  if (name == "none" || name.empty()) return Compression::none;
  if (name == "bz2") return built_in(DKB_HAS_BZ2, "bz2", "libbz2-dev"), Compression::bz2;
  if (name == "lz4") return built_in(DKB_HAS_LZ4, "lz4", "liblz4-dev"), Compression::lz4;
  if (name == "zstd") return built_in(DKB_HAS_ZSTD, "zstd", "libzstd-dev"), Compression::zstd;
  throw InputError("is compressed with \"" + std::string(name.substr(0, 40)) + "\"; none, bz2, lz4 and zstd are read");
}

ChunkState load_chunk(const RecordingFile& file, Compression compression, uint64_t at, uint64_t packed, uint64_t size,
                      ChunkBuffer* out) {
  out->size = 0;
  if (compression == Compression::none) size = packed;
  if (size > kMaxChunk)
    return {ChunkState::broken,
            "it holds " + std::to_string(size >> 20) + " MiB; up to " + std::to_string(kMaxChunk >> 20) + " are read"};
  if (compression == Compression::none) return copy_chunk(file, at, size, out);

  const std::unique_ptr<Decoder> decoder = make_decoder(compression);
  std::vector<char> piece(static_cast<size_t>(std::min<uint64_t>(packed, 1 << 18)));
  std::string_view in;
  const uint64_t end = std::min(file.size(), at + std::min(packed, file.size()));
  const bool cut = at > file.size() || packed > file.size() - at;
  try {
    for (bool ended = false; !(ended && (out->size == size || (in.empty() && at >= end)));) {
      if (in.empty() && at < end) {
        const size_t got = file.read(at, piece.data(), static_cast<size_t>(std::min<uint64_t>(piece.size(), end - at)));
        if (got == 0) break;
        in = {piece.data(), got};
        at += got;
      }
      if (out->size == out->bytes.size()) grow(out, size);
      // With all of the chunk there, what is left of the stream are checksums: there is no more room.
      const size_t before = in.size(),
                   room_before = static_cast<size_t>(std::min<uint64_t>(out->bytes.size(), size) - out->size);
      size_t room = room_before;
      char* to = out->bytes.data() + out->size;
      ended = decoder->step(&in, &to, &room);
      out->size += room_before - room;
      if (in.size() == before && room == room_before && (at >= end || !in.empty())) break;
    }
  } catch (const std::runtime_error& e) {
    if (!cut) out->size = 0;
    return {cut ? ChunkState::cut : ChunkState::broken, e.what()};
  }
  if (out->size == size) return {};
  if (cut) return {ChunkState::cut, ""};
  return {ChunkState::broken,
          "it holds " + std::to_string(out->size) + " bytes where " + std::to_string(size) + " are announced"};
}

std::string compressed([[maybe_unused]] Compression compression, [[maybe_unused]] std::string_view bytes) {
  std::string packed;
  size_t size = 0;
  bool good = false;
#if DKB_HAS_BZ2
  if (compression == Compression::bz2) {
    packed.resize(bytes.size() + bytes.size() / 100 + 601);
    unsigned length = static_cast<unsigned>(packed.size());
    good = BZ2_bzBuffToBuffCompress(packed.data(), &length, const_cast<char*>(bytes.data()),
                                    static_cast<unsigned>(bytes.size()), 9, 0, 0) == BZ_OK;
    size = length;
  }
#endif
#if DKB_HAS_LZ4
  if (compression == Compression::lz4) {
    // Frames as ROS 1 reads them: independent blocks, and a checksum of the content.
    LZ4F_preferences_t options{};
    options.frameInfo.blockSizeID = LZ4F_max4MB;
    options.frameInfo.blockMode = LZ4F_blockIndependent;
    options.frameInfo.contentChecksumFlag = LZ4F_contentChecksumEnabled;
    packed.resize(LZ4F_compressFrameBound(bytes.size(), &options));
    size = LZ4F_compressFrame(packed.data(), packed.size(), bytes.data(), bytes.size(), &options);
    good = !LZ4F_isError(size);
  }
#endif
#if DKB_HAS_ZSTD
  if (compression == Compression::zstd) {
    packed.resize(ZSTD_compressBound(bytes.size()));
    size = ZSTD_compress(packed.data(), packed.size(), bytes.data(), bytes.size(), 1);
    good = !ZSTD_isError(size);
  }
#endif
  if (!good) throw std::logic_error("a chunk that cannot be compressed");
  packed.resize(size);
  return packed;
}

}  // namespace dkb
