// The thin binding of OpenVDB: arrays to grids and back. What a grid means, and every check, is in volumes.py.
//
// Arrays are C order (Z, Y, X) or (Z, Y, X, 3) float32, so x runs fastest in memory: OpenVDB calls that LayoutXYZ.
// Index (i, j, k) of a grid is (x, y, z).

#include <nanobind/nanobind.h>
#include <nanobind/ndarray.h>
#include <nanobind/stl/map.h>
#include <nanobind/stl/string.h>
#include <nanobind/stl/vector.h>
#include <openvdb/io/File.h>
#include <openvdb/openvdb.h>
#include <openvdb/tools/Dense.h>

namespace nb = nanobind;
using Array = nb::ndarray<const float, nb::c_contig, nb::device::cpu>;
using Texts = std::map<std::string, std::string>;

template <typename GridType>
openvdb::GridBase::Ptr grid_of(const Array &values) {
    using Value = typename GridType::ValueType;
    const openvdb::Coord last(int(values.shape(2)) - 1, int(values.shape(1)) - 1, int(values.shape(0)) - 1);
    openvdb::tools::Dense<const Value, openvdb::tools::LayoutXYZ> dense(
        openvdb::CoordBBox(openvdb::Coord(0), last), reinterpret_cast<const Value *>(values.data()));
    auto grid = GridType::create();
    openvdb::tools::copyFromDense(dense, *grid, openvdb::zeroVal<Value>());
    return grid;
}

// Writes one file; each grid is (name, values, metadata). All share the voxel size and origin. A full disk raises
// nothing here.
void write_file(const std::string &path, const std::vector<nb::tuple> &grids, double voxel_size,
                const std::vector<double> &origin, const Texts &metadata, bool half) {
    openvdb::GridPtrVec written;
    for (const nb::tuple &item : grids) {
        const auto values = nb::cast<Array>(item[1]);
        const bool is_vector = values.ndim() == 4;
        auto grid = is_vector ? grid_of<openvdb::Vec3SGrid>(values) : grid_of<openvdb::FloatGrid>(values);
        grid->setName(nb::cast<std::string>(item[0]));
        auto transform = openvdb::math::Transform::createLinearTransform(voxel_size);
        transform->postTranslate(openvdb::Vec3d(origin.at(0), origin.at(1), origin.at(2)));
        grid->setTransform(transform);
        grid->setSaveFloatAsHalf(half);
        if (is_vector)
            grid->setVectorType(openvdb::VEC_CONTRAVARIANT_RELATIVE);
        else
            grid->setGridClass(openvdb::GRID_FOG_VOLUME);
        for (const auto &[key, text] : nb::cast<Texts>(item[2]))
            grid->insertMeta(key, openvdb::StringMetadata(text));
        written.push_back(grid);
    }
    openvdb::MetaMap about;
    for (const auto &[key, text] : metadata) about.insertMeta(key, openvdb::StringMetadata(text));
    openvdb::io::File file(path);
    file.write(written, about);
    file.close();
}

template <typename GridType>
nb::object array_of(const openvdb::GridBase::Ptr &base, const openvdb::CoordBBox &box) {
    using Value = typename GridType::ValueType;
    const openvdb::Coord size = box.dim();
    const size_t components = sizeof(Value) / sizeof(float);
    const size_t count = components * size_t(size.x()) * size_t(size.y()) * size_t(size.z());
    auto *data = new float[count];
    nb::capsule owner(data, [](void *p) noexcept { delete[] static_cast<float *>(p); });
    openvdb::tools::Dense<Value, openvdb::tools::LayoutXYZ> dense(box, reinterpret_cast<Value *>(data));
    openvdb::tools::copyToDense(*openvdb::gridPtrCast<GridType>(base), dense);
    const size_t shape[4] = {size_t(size.z()), size_t(size.y()), size_t(size.x()), 3};
    return nb::cast(nb::ndarray<nb::numpy, float>(data, components == 1 ? 3 : 4, shape, owner));
}

Texts texts_of(const openvdb::MetaMap &metadata) {
    Texts texts;
    for (auto it = metadata.beginMeta(); it != metadata.endMeta(); ++it) texts[it->first] = it->second->str();
    return texts;
}

// The file's metadata, and of each grid its name, type, class, index-to-world matrix (row-major, row vectors),
// the first and last index of its active voxels, and its metadata. Reads no voxels.
nb::tuple file_contents(const std::string &path) {
    openvdb::io::File file(path);
    file.open(/*delayLoad=*/false);
    nb::list grids;
    for (auto name = file.beginName(); name != file.endName(); ++name) {
        const auto grid = file.readGridMetadata(name.gridName());
        std::vector<double> matrix;
        const bool linear = grid->transform().isLinear();
        if (linear) {
            const auto m = grid->transform().baseMap()->getAffineMap()->getMat4();
            matrix.assign(m.asPointer(), m.asPointer() + 16);
        }
        nb::dict about;
        about["name"] = name.gridName();
        about["type"] = grid->valueType();
        about["staggered"] = grid->getGridClass() == openvdb::GRID_STAGGERED;
        about["matrix"] = matrix;
        about["metadata"] = texts_of(*grid);
        grids.append(about);
    }
    auto metadata = file.getMetadata();
    return nb::make_tuple(grids, metadata ? texts_of(*metadata) : Texts());
}

// The grid's values from index 0 up to `size` (x, y, z), or if active voxels lie outside, or `size` is empty, those of
// the active voxels' box. Returns (first index, values). More than `most` voxels raise before memory is taken.
nb::tuple grid_values(const std::string &path, const std::string &name, const std::vector<int> &size, size_t most) {
    openvdb::io::File file(path);
    file.open(/*delayLoad=*/false);
    const auto grid = file.readGrid(name);
    openvdb::CoordBBox box = grid->evalActiveVoxelBoundingBox();
    if (size.empty()) {
        if (box.empty()) throw std::runtime_error("the grid holds no active voxel");
    } else {
        const openvdb::CoordBBox whole({0, 0, 0}, {size.at(0) - 1, size.at(1) - 1, size.at(2) - 1});
        if (box.empty() || whole.isInside(box)) box = whole;
    }
    const double voxels = [&] {  // in double: the indices of a damaged file overflow integers
        double product = 1;
        for (int axis = 0; axis < 3; ++axis) product *= double(box.max()[axis]) - double(box.min()[axis]) + 1;
        return product;
    }();
    if (!(voxels >= 1 && voxels <= double(most)))
        throw std::runtime_error("the grid spans " + std::to_string(voxels) + " voxels");
    const std::vector<int> start = {box.min().x(), box.min().y(), box.min().z()};
    if (grid->isType<openvdb::FloatGrid>()) return nb::make_tuple(start, array_of<openvdb::FloatGrid>(grid, box));
    if (grid->isType<openvdb::Vec3SGrid>()) return nb::make_tuple(start, array_of<openvdb::Vec3SGrid>(grid, box));
    throw std::runtime_error("the grid is of type " + grid->valueType());
}

NB_MODULE(_openvdb, m) {
    openvdb::initialize();
    nb::set_leak_warnings(false);
    m.attr("version") = openvdb::getLibraryVersionString();
    m.def("write", &write_file, nb::arg("path"), nb::arg("grids"), nb::arg("voxel_size"), nb::arg("origin"),
          nb::arg("metadata"), nb::arg("half"));
    m.def("contents", &file_contents, nb::arg("path"));
    m.def("values", &grid_values, nb::arg("path"), nb::arg("name"), nb::arg("size"), nb::arg("most"));
}
