// VTK files: the XML head is parsed and the appended arrays are decoded here, independently of the writer.
#include "files.h"
#include "io/vtp.h"
#include "sph_muscle/io.h"

#include <csignal>
#include <cstring>
#include <map>
#include <regex>
#include <vector>

#include <sys/resource.h>

namespace {

// One array of a .vtp file as it says itself what it is.
struct Array {
    std::string section, type;
    int components = 0;
    std::string bytes;
    template <typename T> std::vector<T> As() const {
        std::vector<T> values(bytes.size() / sizeof(T));
        std::memcpy(values.data(), bytes.data(), values.size() * sizeof(T));
        return values;
    }
};

struct Vtp {
    std::map<std::string, size_t> piece; // NumberOfPoints, ...
    std::map<std::string, Array> arrays; // "Section/Name"
    double time = -1;
    size_t end = 0; // of the last array, in appended bytes

    explicit Vtp(const std::string &file) {
        const std::string start = "<AppendedData encoding=\"raw\">";
        size_t mark = file.find(start);
        EXPECT_NE(mark, std::string::npos);
        std::string head = file.substr(0, mark);
        size_t data = file.find('_', mark) + 1;
        EXPECT_NE(head.find("type=\"PolyData\""), std::string::npos);
        EXPECT_NE(head.find("byte_order=\"LittleEndian\" header_type=\"UInt64\""), std::string::npos);
        std::smatch m;
        if (std::regex_search(head, m, std::regex("Name=\"TimeValue\"[^>]*>([^<]*)<")))
            time = std::stod(m[1]);
        const std::regex number("(NumberOf[A-Z]\\w+)=\"(\\d+)\"");
        for (std::sregex_iterator i(head.begin(), head.end(), number), e; i != e; ++i)
            if ((*i)[1] != "NumberOfComponents" && (*i)[1] != "NumberOfTuples")
                piece[(*i)[1]] = std::stoul((*i)[2]);
        std::regex tag("<(Points|PointData|Verts|Polys)>|<DataArray type=\"(\\w+)\" Name=\"(\\w+)\" "
                       "NumberOfComponents=\"(\\d)\" format=\"appended\" offset=\"(\\d+)\"/>");
        std::string section;
        for (std::sregex_iterator i(head.begin(), head.end(), tag), e; i != e; ++i) {
            if ((*i)[1].matched) {
                section = (*i)[1];
                continue;
            }
            size_t offset = std::stoul((*i)[5]);
            uint64_t bytes = 0;
            EXPECT_EQ(offset, end) << "arrays without gaps";
            std::memcpy(&bytes, file.data() + data + offset, sizeof bytes);
            Array a;
            a.section = section, a.type = (*i)[2], a.components = std::stoi((*i)[4]);
            a.bytes = file.substr(data + offset + sizeof bytes, bytes);
            EXPECT_EQ(a.bytes.size(), bytes) << "truncated";
            end = offset + sizeof bytes + bytes;
            arrays[section + "/" + (*i)[3].str()] = a;
        }
        EXPECT_EQ(file.substr(data + end), "\n  </AppendedData>\n</VTKFile>\n");
    }
};

struct Vtk : testing::Test {
    TemporaryFolder folder;
    sphm_context context{};
    std::string path = folder / "a.vtp";
};

TEST_F(Vtk, ArraysComeBackAsTheyWere) {
    const float points[] = {0, 0, 0, 1, 0, 0, 0, 1, 0, 0, 0, 1}, field[] = {-1, 2.5f, 1e30f, 0};
    const uint8_t flags[] = {0, 1, 2, 255};
    const int32_t triangles[] = {0, 1, 2, 0, 2, 3};
    const sphm_vtp_array arrays[] = {
        {SPHM_VTP_POINTS, "position_m", SPHM_VTP_FLOAT32, 3, 4, points, 0, 0},
        {SPHM_VTP_POINT_DATA, "field_Pa", SPHM_VTP_FLOAT32, 1, 4, field, 0, 0},
        {SPHM_VTP_POINT_DATA, "flags", SPHM_VTP_UINT8, 1, 4, flags, 0, 0},
        {SPHM_VTP_VERTICES, "connectivity", SPHM_VTP_INT64, 1, 1500, nullptr, 0, 1},
        {SPHM_VTP_VERTICES, "offsets", SPHM_VTP_INT64, 1, 1500, nullptr, 1, 1},
        {SPHM_VTP_TRIANGLES, "connectivity", SPHM_VTP_INT32, 1, 6, triangles, 0, 0},
        {SPHM_VTP_TRIANGLES, "offsets", SPHM_VTP_INT64, 1, 2, nullptr, 3, 3},
    };
    ASSERT_EQ(sphm_vtp_write(path.c_str(), 0.125, arrays, 7, &context), SPHM_OK) << context.message;
    Vtp file(ReadFile(path));
    EXPECT_EQ(file.time, 0.125);
    EXPECT_EQ(file.piece["NumberOfPoints"], 4u);
    EXPECT_EQ(file.piece["NumberOfVerts"], 1500u);
    EXPECT_EQ(file.piece["NumberOfPolys"], 2u);
    ASSERT_EQ(file.arrays.size(), 7u);
    EXPECT_EQ(file.arrays["Points/position_m"].components, 3);
    EXPECT_EQ(file.arrays["Points/position_m"].As<float>(), std::vector<float>(points, points + 12));
    EXPECT_EQ(file.arrays["PointData/field_Pa"].As<float>(), std::vector<float>(field, field + 4));
    EXPECT_EQ(file.arrays["PointData/flags"].As<uint8_t>(), std::vector<uint8_t>(flags, flags + 4));
    EXPECT_EQ(file.arrays["PointData/flags"].type, "UInt8");
    EXPECT_EQ(file.arrays["Polys/connectivity"].As<int32_t>(),
              std::vector<int32_t>(triangles, triangles + 6));
    EXPECT_EQ(file.arrays["Polys/offsets"].As<int64_t>(), (std::vector<int64_t>{3, 6}));
    std::vector<int64_t> vertices = file.arrays["Verts/connectivity"].As<int64_t>();
    ASSERT_EQ(vertices.size(), 1500u); // beyond one block of the writer
    for (int64_t i = 0; i < 1500; i++)
        ASSERT_EQ(vertices[static_cast<size_t>(i)], i);
}

TEST_F(Vtk, AFileThatCannotBeWrittenIsNamed) {
    const std::vector<float> points(300000, 1.0f);
    const sphm_vtp_array a = {
        SPHM_VTP_POINTS, "position_m", SPHM_VTP_FLOAT32, 3, 100000, points.data(), 0, 0};
    EXPECT_EQ(sphm_vtp_write((folder / "no/a.vtp").c_str(), 0, &a, 1, &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "no/a.vtp"), nullptr);
    EXPECT_EQ(sphm_vtp_write("/dev/full", 0, &a, 1, &context), SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "No space"), nullptr) << context.message;
    EXPECT_TRUE(std::filesystem::exists("/dev/full"));
}

// A limit on the size of files stands for a full disk: a good half of the file is written before it fails.
TEST_F(Vtk, ABrokenFileIsNotLeftBehind) {
    const std::vector<float> points(300000, 1.0f);
    const sphm_vtp_array a = {
        SPHM_VTP_POINTS, "position_m", SPHM_VTP_FLOAT32, 3, 100000, points.data(), 0, 0};
    rlimit before, small;
    ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
    small = before;
    small.rlim_cur = 600000;
    void (*handler)(int) = signal(SIGXFSZ, SIG_IGN);
    ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &small), 0);
    sphm_status status = sphm_vtp_write(path.c_str(), 0, &a, 1, &context);
    setrlimit(RLIMIT_FSIZE, &before);
    signal(SIGXFSZ, handler);
    EXPECT_EQ(status, SPHM_REFUSED_FILE);
    EXPECT_NE(std::strstr(context.message, "too large"), nullptr) << context.message;
    EXPECT_FALSE(std::filesystem::exists(path));
}

TEST_F(Vtk, ACollectionIsCompleteAfterEveryFile) {
    const std::string
        head = "<?xml version=\"1.0\"?>\n<VTKFile type=\"Collection\" version=\"1.0\">\n  <Collection>\n",
        tail = "  </Collection>\n</VTKFile>\n";
    sphm_collection *collection = nullptr;
    std::string pvd = folder / "a.pvd";
    ASSERT_EQ(sphm_io_collection_open(pvd.c_str(), &collection, &context), SPHM_OK) << context.message;
    EXPECT_EQ(ReadFile(pvd), head + tail);
    EXPECT_EQ(sphm_io_collection_add(collection, 0, "vtk/a_0.vtp", &context), SPHM_OK);
    EXPECT_EQ(sphm_io_collection_add(collection, 0.1, "vtk/\"a\"&<1>.vtp", &context), SPHM_OK);
    EXPECT_EQ(ReadFile(pvd), head +
                                 "    <DataSet timestep=\"0\" part=\"0\" file=\"vtk/a_0.vtp\"/>\n"
                                 "    <DataSet timestep=\"0.1\" part=\"0\" "
                                 "file=\"vtk/&quot;a&quot;&amp;&lt;1>.vtp\"/>\n" +
                                 tail);
    EXPECT_EQ(sphm_io_collection_close(collection, &context), SPHM_OK);
    EXPECT_EQ(sphm_io_collection_close(nullptr, &context), SPHM_OK);
    EXPECT_EQ(sphm_io_collection_open((folder / "no/a.pvd").c_str(), &collection, &context),
              SPHM_REFUSED_FILE);
    EXPECT_EQ(sphm_io_collection_open("/dev/full", &collection, &context), SPHM_REFUSED_FILE);
    EXPECT_EQ(collection, nullptr);
}

// A muscle's files hold what the muscle says, particle by particle.
TEST_F(Vtk, ParticlesAndSurfaceOfAMuscle) {
    sphm_parameters p = sphm_parameters_default();
    p.particles = 500;
    p.threads = 1;
    sphm_muscle *muscle = nullptr;
    ASSERT_EQ(sphm_io_create_muscle(&p, &muscle, &context), SPHM_OK) << context.message;
    ASSERT_EQ(sphm_muscle_stimulate(muscle, nullptr, 8000, 0, &context), SPHM_OK);
    ASSERT_EQ(sphm_muscle_advance(muscle, 0.02, &context), SPHM_OK) << context.message;
    ASSERT_EQ(sphm_io_write_particles_vtk(muscle, path.c_str(), &context), SPHM_OK) << context.message;
    sphm_particles particles;
    ASSERT_EQ(sphm_muscle_particles(muscle, &particles, &context), SPHM_OK);
    size_t n = particles.count;
    {
        Vtp file(ReadFile(path));
        EXPECT_NEAR(file.time, 0.02, 1e-12);
        EXPECT_EQ(file.piece["NumberOfPoints"], n);
        EXPECT_EQ(file.piece["NumberOfVerts"], n);
        auto same = [&](const char *name, const float *values, size_t components) {
            EXPECT_EQ(file.arrays[name].As<float>(), std::vector<float>(values, values + components * n))
                << name;
        };
        same("Points/position_m", particles.position_m, 3);
        same("PointData/displacement_m", particles.displacement_m, 1);
        same("PointData/pressure_Pa", particles.pressure_Pa, 1);
        same("PointData/electrical_pressure_Pa", particles.electrical_pressure_Pa, 1);
        same("PointData/density_kg_per_m3", particles.density_kg_per_m3, 1);
        same("PointData/membrane_potential_mV", particles.membrane_potential_mV, 1);
        same("PointData/recovery", particles.recovery, 1);
        same("PointData/activation", particles.activation, 1);
        same("PointData/fibre_stretch", particles.fibre_stretch, 1);
        const double *volumes = sphm_muscle_body(muscle)->volumes;
        const std::vector<float> rest_volumes(volumes, volumes + n);
        same("PointData/rest_volume_m3", rest_volumes.data(), 1);
        same("PointData/velocity_m_per_s", particles.velocity_m_per_s, 3);
        same("PointData/displacement_vector_m", particles.displacement_vector_m, 3);
        EXPECT_EQ(file.arrays["PointData/region"].bytes.size(), n);
    }
    ASSERT_EQ(sphm_io_write_surface_vtk(muscle, path.c_str(), &context), SPHM_OK) << context.message;
    sphm_skin skin;
    ASSERT_EQ(sphm_muscle_skin(muscle, SPHM_FIELD_PRESSURE, &skin, &context), SPHM_OK);
    Vtp file(ReadFile(path));
    EXPECT_EQ(file.piece["NumberOfPoints"], skin.vertex_count);
    EXPECT_EQ(file.piece["NumberOfPolys"], skin.triangle_count);
    EXPECT_EQ(file.arrays["Points/position_m"].As<float>(),
              std::vector<float>(skin.vertices_m, skin.vertices_m + 3 * skin.vertex_count));
    EXPECT_EQ(file.arrays["PointData/pressure_Pa"].As<float>(),
              std::vector<float>(skin.field, skin.field + skin.vertex_count));
    EXPECT_EQ(file.arrays["Polys/connectivity"].As<int32_t>(),
              std::vector<int32_t>(skin.triangles, skin.triangles + 3 * skin.triangle_count));
    for (const char *name : {"displacement_m", "membrane_potential_mV", "activation", "fibre_stretch"})
        EXPECT_EQ(file.arrays[std::string("PointData/") + name].bytes.size(), 4 * skin.vertex_count) << name;
    sphm_muscle_destroy(muscle);
}

} // namespace
