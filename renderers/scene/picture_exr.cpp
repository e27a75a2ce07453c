// Pictures to measure in programs that read OpenEXR.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfIO.h>
#include <ImfOutputFile.h>
#include <fmt/format.h>

#include <cstring>

#include "renderers/scene/picture.hpp"
#include "structures/mesh/error.hpp"
#include "structures/mesh/whole_file.hpp"

namespace amrtex {
namespace {

/// The file's bytes, which are then written under a temporary name first as all others are.
class StringStream : public OPENEXR_IMF_NAMESPACE::OStream {
 public:
  explicit StringStream(const std::string& name) : OStream(name.c_str()) {}
  void write(const char bytes[], int count) override {
    const auto n = static_cast<std::size_t>(count);
    if (text_.size() < at_ + n) text_.resize(at_ + n);
    std::memcpy(text_.data() + at_, bytes, n);
    at_ += n;
  }
  std::uint64_t tellp() override { return at_; }
  void seekp(std::uint64_t place) override { at_ = place; }
  const std::string& text() const { return text_; }

 private:
  std::string text_;
  std::size_t at_ = 0;
};

}  // namespace

void write_exr(const Picture& picture, const std::filesystem::path& path) {
  namespace imf = OPENEXR_IMF_NAMESPACE;
  if (picture.width < 1 || picture.height < 1 || (picture.channels != 1 && picture.channels != 4))
    throw Error(fmt::format("{}: a picture of {} x {} pixels and {} channels; EXR takes 1 or 4 channels", path.string(),
                            picture.width, picture.height, picture.channels));
  std::vector<float> floats(picture.values.size());
  for (std::size_t i = 0; i < floats.size(); ++i) floats[i] = static_cast<float>(picture.values[i]);
  imf::Header header(picture.width, picture.height);
  header.compression() = imf::ZIP_COMPRESSION;
  imf::FrameBuffer buffer;
  const std::size_t pixel = sizeof(float) * static_cast<std::size_t>(picture.channels);
  const char* const names[] = {"R", "G", "B", "A"};
  for (int c = 0; c < picture.channels; ++c) {
    const char* name = picture.channels == 1 ? "Y" : names[c];
    header.channels().insert(name, imf::Channel(imf::FLOAT));
    buffer.insert(name, imf::Slice(imf::FLOAT, reinterpret_cast<char*>(floats.data() + c), pixel,
                                   pixel * static_cast<std::size_t>(picture.width)));
  }
  StringStream stream(path.string());
  try {
    imf::OutputFile file(stream, header);
    file.setFrameBuffer(buffer);
    file.writePixels(picture.height);
  } catch (const std::exception& e) {
    throw Error(fmt::format("{}: cannot be written: {}", path.string(), e.what()));
  }
  write_atomically(path, stream.text());
}

}  // namespace amrtex
